#include "rotodom/sequence/video/video_container.h"

#include <array>
#include <cstring>
#include <iomanip>
#include <mutex>
#include <new>
#include <sstream>
#include <utility>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/imgutils.h>
#include <libavutil/log.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

namespace rotslam {

void FfmpegDeleter::operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
void FfmpegDeleter::operator()(AVFormatContext* container) const {
  avformat_close_input(&container);
}
void FfmpegDeleter::operator()(AVFrame* frame) const { av_frame_free(&frame); }
void FfmpegDeleter::operator()(AVPacket* packet) const { av_packet_free(&packet); }
void FfmpegDeleter::operator()(SwsContext* scaler) const { sws_freeContext(scaler); }

namespace {

namespace fs = std::filesystem;

// Containers of film, by FFmpeg's names. Others show text, single pictures or devices as film, or
// are lists that name further files and addresses.
constexpr const char* kContainers =
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,flv,asf,gif,apng,ogg,mxf,mxf_opatom,ivf,"
    "nut,dv,rm,wtv,gxf,yuv4mpegpipe,h264,hevc,vvc,m4v,mjpeg,mpegvideo,vc1,obu,av1";

// Those of them that are frames and no container around: FFmpeg numbers some at 25 a second.
constexpr const char* kBareStreams = "h264,hevc,vvc,m4v,mjpeg,mpegvideo,vc1,obu,av1";

// What FFmpeg calls its containers and codecs, and what people call them.
constexpr std::array<std::pair<std::string_view, const char*>, 22> kPlainNames = {{
    {"h264", "H.264"},
    {"hevc", "H.265"},
    {"vvc", "H.266"},
    {"mjpeg", "Motion JPEG"},
    {"mpeg4", "MPEG-4"},
    {"mpeg2video", "MPEG-2"},
    {"mpeg1video", "MPEG-1"},
    {"vp8", "VP8"},
    {"vp9", "VP9"},
    {"av1", "AV1"},
    {"prores", "ProRes"},
    {"ffv1", "FFV1"},
    {"gif", "GIF"},
    {"apng", "APNG"},
    {"rawvideo", "raw pixels"},
    {"avi", "AVI"},
    {"mpegts", "MPEG-TS"},
    {"mpeg", "MPEG-PS"},
    {"asf", "ASF"},
    {"flv", "Flash"},
    {"ogg", "Ogg"},
    {"yuv4mpegpipe", "YUV4MPEG"},
}};

bool IsListed(const char* list, const char* names) {
  std::istringstream words(names);
  for (std::string name; std::getline(words, name, ',');) {
    if (("," + std::string(list) + ",").find("," + name + ",") != std::string::npos) return true;
  }
  return false;
}

// The display matrix in the side data of a stream, which moved in FFmpeg 6.1; nullptr: none.
const std::uint8_t* StreamDisplayMatrix(const AVStream& stream, std::size_t& size) {
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(60, 31, 102)
  const AVPacketSideData* data = av_packet_side_data_get(stream.codecpar->coded_side_data,
                                                         stream.codecpar->nb_coded_side_data,
                                                         AV_PKT_DATA_DISPLAYMATRIX);
  if (data == nullptr) return nullptr;
  size = data->size;
  return data->data;
#else
  return av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, &size);
#endif
}

// A reader of files only: lists in a container are not followed to other places.
FfmpegPointer<AVFormatContext> NewContainer() {
  FfmpegPointer<AVFormatContext> container(avformat_alloc_context());
  if (container == nullptr) throw std::bad_alloc();
  container->protocol_whitelist = av_strdup("file");
  container->format_whitelist = av_strdup(kContainers);
  return container;
}

ProbedFormat ProbeFormat(const fs::path& path, const std::string& url) {
  ProbedFormat probed;
  AVIOContext* file = nullptr;
  probed.error = avio_open2(&file, url.c_str(), AVIO_FLAG_READ, nullptr, nullptr);
  if (probed.error < 0) return probed;
  const int score = av_probe_input_buffer2(file, &probed.format, path.c_str(), nullptr, 0, 0);
  avio_closep(&file);
  if (score < 0) {
    probed.error = score;
    probed.format = nullptr;
    return probed;
  }
  probed.is_sure = score > AVPROBE_SCORE_EXTENSION;
  // A row of JPEG files looks like a single one.
  const std::string extension = path.extension().string();
  const bool is_row = extension == ".mjpeg" || extension == ".mjpg" || extension == ".MJPG";
  if (is_row && IsListed("jpeg_pipe", probed.format->name)) {
    probed.format = av_find_input_format("mjpeg");
  }
  return probed;
}

}  // namespace

void QuietFfmpeg() {
  static std::once_flag once;
  std::call_once(once, [] { av_log_set_level(AV_LOG_QUIET); });
}

std::optional<DisplayMatrix> FindDisplayMatrix(const AVFrame& frame, const AVStream& stream) {
  DisplayMatrix matrix = {};
  std::size_t size = 0;
  const std::uint8_t* bytes = nullptr;
  if (const AVFrameSideData* data = av_frame_get_side_data(&frame, AV_FRAME_DATA_DISPLAYMATRIX)) {
    bytes = data->data;
    size = data->size;
  } else {
    bytes = StreamDisplayMatrix(stream, size);
  }
  if (bytes == nullptr || size < sizeof(matrix)) return std::nullopt;
  std::memcpy(matrix.data(), bytes, sizeof(matrix));
  return matrix;
}

bool IsInterlaced(const AVFrame& frame) {
#if LIBAVUTIL_VERSION_INT >= AV_VERSION_INT(58, 29, 100)
  return (frame.flags & AV_FRAME_FLAG_INTERLACED) != 0;
#else
  return frame.interlaced_frame != 0;
#endif
}

std::string DamageOf(const AVFrame& frame) {
  const bool is_damaged =
      (frame.flags & AV_FRAME_FLAG_CORRUPT) != 0 || frame.decode_error_flags != 0;
  return is_damaged ? "frame of the video is damaged" : "";
}

bool IsMovie(const AVInputFormat& format) { return IsListed(format.name, "mov"); }

bool IsBareStream(const AVInputFormat& format) { return IsListed(kBareStreams, format.name); }

int OpenInputFile(const fs::path& path,
                  FfmpegPointer<AVFormatContext>& container,
                  ProbedFormat& probed) {
  // With `file:` a colon in the name is no protocol.
  const std::string url = "file:" + path.string();
  probed = ProbeFormat(path, url);
  if (probed.format == nullptr) return probed.error;
  if (!IsListed(kContainers, probed.format->name)) return AVERROR_DEMUXER_NOT_FOUND;
  AVFormatContext* raw = NewContainer().release();
  // Frees it when it fails.
  const int error = avformat_open_input(&raw, url.c_str(), probed.format, nullptr);
  container.reset(error < 0 ? nullptr : raw);
  return error;
}

std::int64_t CountPackets(const fs::path& path, int stream_index) {
  FfmpegPointer<AVFormatContext> container;
  ProbedFormat probed;
  if (OpenInputFile(path, container, probed) < 0) return -1;
  const FfmpegPointer<AVPacket> packet(av_packet_alloc());
  std::int64_t count = 0;
  for (;;) {
    // Streams may turn up late.
    for (unsigned k = 0; k < container->nb_streams; ++k) {
      const bool is_ours = static_cast<int>(k) == stream_index;
      container->streams[k]->discard = is_ours ? AVDISCARD_DEFAULT : AVDISCARD_ALL;
    }
    if (av_read_frame(container.get(), packet.get()) < 0) break;
    const bool is_shown = (packet->flags & AV_PKT_FLAG_DISCARD) == 0;
    if (packet->stream_index == stream_index && is_shown) ++count;
    av_packet_unref(packet.get());
  }
  return count;
}

bool IsFilm(const AVStream& stream) {
  return stream.codecpar->codec_type == AVMEDIA_TYPE_VIDEO &&
         (stream.disposition & (AV_DISPOSITION_ATTACHED_PIC | AV_DISPOSITION_TIMED_THUMBNAILS)) ==
             0;
}

std::int64_t PixelsOf(const AVStream& stream) {
  return std::int64_t{stream.codecpar->width} * stream.codecpar->height;
}

void AddTags(const AVDictionary* tags, std::map<std::string, std::string>& metadata) {
  const AVDictionaryEntry* tag = nullptr;
  while ((tag = av_dict_get(tags, "", tag, AV_DICT_IGNORE_SUFFIX)) != nullptr) {
    metadata.emplace(tag->key, tag->value);
  }
}

int RowsToConvert(const AVFrame& frame, const AVCodecContext& codec) {
  if (frame.height % 2 == 0 || codec.coded_height <= frame.height) return frame.height;
  const AVPixFmtDescriptor* format = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  if (format == nullptr || frame.buf[0] == nullptr) return frame.height;
  for (int plane = 0; plane < 4 && frame.data[plane] != nullptr; ++plane) {
    const AVBufferRef* buffer = av_frame_get_plane_buffer(const_cast<AVFrame*>(&frame), plane);
    const bool is_chroma = plane == 1 || plane == 2;
    const int rows =
        is_chroma ? -((-(frame.height + 1)) >> format->log2_chroma_h) : frame.height + 1;
    if (buffer == nullptr || frame.linesize[plane] < 0) return frame.height;
    const std::uint8_t* end = frame.data[plane] + std::int64_t{frame.linesize[plane]} * rows;
    if (end > buffer->data + buffer->size) return frame.height;
  }
  return frame.height + 1;
}

std::string PlainName(std::string_view name) {
  for (const auto& [theirs, ours] : kPlainNames) {
    if (name == theirs) return ours;
  }
  return std::string(name);
}

std::string VideoSizeText(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

std::string NumberText(double number) {
  std::ostringstream text;
  text << std::setprecision(6) << number;
  return text.str();
}

std::string CountText(std::int64_t count, const char* thing) {
  return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
}

std::string ErrorText(int error) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text = {};
  av_strerror(error, text.data(), text.size());
  return text.data();
}

std::string StreamText(const AVStream& stream) {
  const AVCodecParameters& codec = *stream.codecpar;
  return std::to_string(stream.index) + " (" + PlainName(avcodec_get_name(codec.codec_id)) + ", " +
         VideoSizeText(codec.width, codec.height) + ")";
}

std::string ContainerText(const AVFormatContext& container, const fs::path& path) {
  const std::string name = container.iformat->name;
  if (IsListed(name.c_str(), "mov")) {
    const AVDictionaryEntry* brand = av_dict_get(container.metadata, "major_brand", nullptr, 0);
    const bool is_quicktime = brand != nullptr && std::string_view(brand->value).starts_with("qt");
    return is_quicktime || (brand == nullptr && path.extension() != ".mp4") ? "QuickTime" : "MP4";
  }
  if (IsListed(name.c_str(), "matroska")) {
    return path.extension() == ".webm" ? "WebM" : "Matroska";
  }
  return PlainName(name);
}

std::string RatioText(const AVRational& ratio) {
  return std::to_string(ratio.num) + ":" + std::to_string(ratio.den);
}

}  // namespace rotslam
