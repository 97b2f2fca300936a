#include "tests/rotodom/sequence/test_video.h"

#include <array>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>

#include <opencv2/core.hpp>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/imgutils.h>
#include <libavutil/log.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

namespace rotslam {
namespace {

void Check(int result, const char* call) {
  if (result < 0)
    throw std::runtime_error(std::string(call) + " failed: " + std::to_string(result));
}

// One stream's encoder.
class Encoder {
 public:
  Encoder(const TestStream& source, AVFormatContext* container) : source_(source) {
    stream_ = avformat_new_stream(container, nullptr);
    const int ticks_per_second = static_cast<int>(source.fps);
    stream_->time_base = {1, ticks_per_second};
    if (source.codec.empty()) {
      stream_->codecpar->codec_type = AVMEDIA_TYPE_AUDIO;
      stream_->codecpar->codec_id = AV_CODEC_ID_PCM_S16LE;
      stream_->codecpar->sample_rate = 8000;
      stream_->codecpar->bits_per_coded_sample = 16;
      stream_->codecpar->block_align = 2;
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(59, 24, 100)
      stream_->codecpar->ch_layout.order = AV_CHANNEL_ORDER_UNSPEC;
      stream_->codecpar->ch_layout.nb_channels = 1;
#endif
      return;
    }
    const AVCodec* codec = avcodec_find_encoder_by_name(source.codec.c_str());
    if (codec == nullptr) throw std::runtime_error("no encoder " + source.codec);
    context_ = avcodec_alloc_context3(codec);
    context_->width = source.pictures.front().cols;
    context_->height = source.pictures.front().rows;
    context_->pix_fmt = source.codec == "mjpeg" ? AV_PIX_FMT_YUVJ420P : AV_PIX_FMT_YUV420P;
    context_->time_base = {1, ticks_per_second};
    context_->framerate = {ticks_per_second, 1};
    context_->sample_aspect_ratio = {source.pixel_width, source.pixel_height};
    context_->max_b_frames = source.num_b_frames;
    context_->gop_size = source.key_frame_distance;
    context_->flags |= AV_CODEC_FLAG_QSCALE | AV_CODEC_FLAG_BITEXACT;
    context_->global_quality = 2 * FF_QP2LAMBDA;
    context_->thread_count = 1;
    if ((container->oformat->flags & AVFMT_GLOBALHEADER) != 0) {
      context_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    }
    // Key frames where they are asked for, and nowhere else.
    if (source.codec == "libx264") {
      av_opt_set(context_->priv_data, "x264-params", "scenecut=0:log-level=-1", 0);
    }
    Check(avcodec_open2(context_, codec, nullptr), "avcodec_open2");
    Check(avcodec_parameters_from_context(stream_->codecpar, context_), "parameters");
    stream_->sample_aspect_ratio = context_->sample_aspect_ratio;
  }
  ~Encoder() { avcodec_free_context(&context_); }
  Encoder(const Encoder&) = delete;
  Encoder& operator=(const Encoder&) = delete;

  void Write(AVFormatContext* container) {
    if (context_ == nullptr) return WriteSilence(container);
    for (std::size_t k = 0; k <= source_.pictures.size(); ++k) {
      AVFrame* frame = k < source_.pictures.size() ? FrameOf(k) : nullptr;
      Check(avcodec_send_frame(context_, frame), "avcodec_send_frame");
      av_frame_free(&frame);
      AVPacket* packet = av_packet_alloc();
      while (avcodec_receive_packet(context_, packet) >= 0) {
        packet->duration = 1;
        av_packet_rescale_ts(packet, context_->time_base, stream_->time_base);
        packet->stream_index = stream_->index;
        Check(av_interleaved_write_frame(container, packet), "av_interleaved_write_frame");
      }
      av_packet_free(&packet);
    }
  }

 private:
  void WriteSilence(AVFormatContext* container) {
    AVPacket* packet = av_packet_alloc();
    Check(av_new_packet(packet, 1600), "av_new_packet");
    std::memset(packet->data, 0, 1600);
    packet->pts = packet->dts = 0;
    packet->duration = stream_->time_base.den / 10;
    packet->stream_index = stream_->index;
    Check(av_interleaved_write_frame(container, packet), "av_interleaved_write_frame");
    av_packet_free(&packet);
  }

  AVFrame* FrameOf(std::size_t k) const {
    const cv::Mat& picture = source_.pictures[k];
    AVFrame* frame = av_frame_alloc();
    frame->width = picture.cols;
    frame->height = picture.rows;
    frame->format = context_->pix_fmt;
    frame->quality = context_->global_quality;
    frame->pts = source_.times.empty() ? static_cast<std::int64_t>(k) : source_.times[k];
    Check(av_frame_get_buffer(frame, 0), "av_frame_get_buffer");
    SwsContext* scaler = sws_getContext(picture.cols,
                                        picture.rows,
                                        AV_PIX_FMT_BGR24,
                                        picture.cols,
                                        picture.rows,
                                        context_->pix_fmt,
                                        SWS_BICUBIC,
                                        nullptr,
                                        nullptr,
                                        nullptr);
    const std::array<const std::uint8_t*, 4> data = {picture.data, nullptr, nullptr, nullptr};
    const std::array<int, 4> strides = {static_cast<int>(picture.step[0]), 0, 0, 0};
    sws_scale(scaler, data.data(), strides.data(), 0, picture.rows, frame->data, frame->linesize);
    sws_freeContext(scaler);
    return frame;
  }

  TestStream source_;
  AVStream* stream_ = nullptr;
  AVCodecContext* context_ = nullptr;
};

}  // namespace

bool HasEncoder(const std::string& codec) {
  return avcodec_find_encoder_by_name(codec.c_str()) != nullptr;
}

void WriteTestVideo(const std::filesystem::path& file,
                    const std::vector<TestStream>& streams,
                    const std::map<std::string, std::string>& tags) {
  av_log_set_level(AV_LOG_QUIET);
  AVFormatContext* container = nullptr;
  const char* format = file.extension() == ".m4v" ? "m4v" : nullptr;  // else an MP4 file
  Check(avformat_alloc_output_context2(&container, nullptr, format, file.c_str()), "container");
  container->flags |= AVFMT_FLAG_BITEXACT;
  std::vector<std::unique_ptr<Encoder>> encoders;
  for (const TestStream& stream : streams) {
    encoders.push_back(std::make_unique<Encoder>(stream, container));
  }
  Check(avio_open(&container->pb, file.c_str(), AVIO_FLAG_WRITE), "avio_open");
  AVDictionary* muxer_options = nullptr;
  if (!tags.empty()) av_dict_set(&muxer_options, "movflags", "use_metadata_tags", 0);
  for (const auto& [key, value] : tags) {
    av_dict_set(&container->metadata, key.c_str(), value.c_str(), 0);
  }
  Check(avformat_write_header(container, &muxer_options), "avformat_write_header");
  av_dict_free(&muxer_options);
  for (const auto& encoder : encoders) encoder->Write(container);
  Check(av_write_trailer(container), "av_write_trailer");
  avio_closep(&container->pb);
  encoders.clear();
  avformat_free_context(container);
}

std::vector<cv::Mat> GreyPictures(int count, const cv::Size& size) {
  std::vector<cv::Mat> pictures;
  for (int k = 0; k < count; ++k) {
    pictures.emplace_back(size, CV_8UC3, cv::Scalar::all(20.0 * k + 10.0));
  }
  return pictures;
}

cv::Mat FourColours(const cv::Size& size) {
  cv::Mat image(size, CV_8UC3);
  const int x = size.width / 2;
  const int y = size.height / 2;
  image(cv::Rect(0, 0, x, y)) = cv::Scalar(0, 0, 255);
  image(cv::Rect(x, 0, size.width - x, y)) = cv::Scalar(0, 255, 0);
  image(cv::Rect(0, y, x, size.height - y)) = cv::Scalar(255, 0, 0);
  image(cv::Rect(x, y, size.width - x, size.height - y)) = cv::Scalar(255, 255, 255);
  return image;
}

std::string CornersOf(const cv::Mat& image) {
  std::string colours;
  for (const int y : {4, image.rows - 5}) {
    for (const int x : {4, image.cols - 5}) {
      const auto pixel = image.at<cv::Vec3b>(y, x);
      const bool blue = pixel[0] > 128;
      const bool green = pixel[1] > 128;
      const bool red = pixel[2] > 128;
      colours += blue && green && red ? 'w' : (red ? 'r' : (green ? 'g' : (blue ? 'b' : '?')));
    }
  }
  return colours;
}

void PatchDisplayMatrix(const std::filesystem::path& file,
                        const std::vector<std::int32_t>& matrix) {
  std::ifstream in(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  in.close();
  const std::size_t header = bytes.find("tkhd");
  if (header == std::string::npos) throw std::runtime_error("no track header");
  // Version 0: 4 bytes of name, 4 of version and flags, 20 of times, duration and track, 16 others.
  std::size_t at = header + 44;
  for (const std::int32_t value : matrix) {
    const auto bits = static_cast<std::uint32_t>(value);
    for (int shift = 24; shift >= 0; shift -= 8) {
      bytes[at++] = static_cast<char>(static_cast<unsigned char>(bits >> shift));
    }
  }
  std::ofstream(file, std::ios::binary) << bytes;
}

}  // namespace rotslam
