#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "rotodom/sequence/video/ffmpeg_pointer.h"
#include "rotodom/sequence/video/video_orientation.h"

// Texts about files, streams and frames from FFmpeg's libraries. Used by VideoFile alone.

struct AVDictionary;
struct AVInputFormat;
struct AVRational;
struct AVStream;

namespace rotslam {

/// FFmpeg writes to stderr by itself what is said here in words of our own.
void QuietFfmpeg();

/// The container of a file, by its bytes and, where these are not sure, its name.
struct ProbedFormat {
  const AVInputFormat* format = nullptr;  // nullptr: none
  bool is_sure = false;                   // it is not the name alone that says so
  int error = 0;
};

/// Opens `path`; on failure returns FFmpeg's error and leaves `container` empty.
int OpenInputFile(const std::filesystem::path& path,
                  FfmpegPointer<AVFormatContext>& container,
                  ProbedFormat& probed);

bool IsMovie(const AVInputFormat& format);

/// Whether the format is frames and no container around: FFmpeg numbers some at 25 a second.
bool IsBareStream(const AVInputFormat& format);

/// Whether a stream is film: no cover picture, no thumbnails.
bool IsFilm(const AVStream& stream);
std::int64_t PixelsOf(const AVStream& stream);

/// Frames of the stream by its packets; nothing is decoded. -1: the file cannot be opened.
std::int64_t CountPackets(const std::filesystem::path& path, int stream_index);

/// A frame's own (H.264 and H.265 may carry one) goes before the stream's, as for ffmpeg.
std::optional<DisplayMatrix> FindDisplayMatrix(const AVFrame& frame, const AVStream& stream);
bool IsInterlaced(const AVFrame& frame);

/// The damage of a frame that was decoded all the same; empty: none.
std::string DamageOf(const AVFrame& frame);

/// The fast conversions of swscale take an even number of rows. A decoder's buffers are larger than
/// its pictures, so that the row below an odd last one may be read, too.
int RowsToConvert(const AVFrame& frame, const AVCodecContext& codec);

void AddTags(const AVDictionary* tags, std::map<std::string, std::string>& metadata);

// ---- texts

/// The usual name of a container or codec that FFmpeg names otherwise.
std::string PlainName(std::string_view name);
std::string ContainerText(const AVFormatContext& container, const std::filesystem::path& path);
std::string StreamText(const AVStream& stream);
std::string ErrorText(int error);
std::string VideoSizeText(int width, int height);
std::string NumberText(double number);
std::string CountText(std::int64_t count, const char* thing);

/// The text of a rational that is no more than that: 4:3.
std::string RatioText(const AVRational& ratio);

}  // namespace rotslam
