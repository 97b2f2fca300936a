#pragma once

#include <memory>

// FFmpeg's.
struct AVCodecContext;
struct AVFormatContext;
struct AVFrame;
struct AVPacket;
struct SwsContext;

namespace rotslam {

/// Frees what FFmpeg has made.
struct FfmpegDeleter {
  void operator()(AVCodecContext* codec) const;
  void operator()(AVFormatContext* container) const;
  void operator()(AVFrame* frame) const;
  void operator()(AVPacket* packet) const;
  void operator()(SwsContext* scaler) const;
};

template <class T>
using FfmpegPointer = std::unique_ptr<T, FfmpegDeleter>;

}  // namespace rotslam
