#include "rotodom/sequence/video/video_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include "rotodom/sequence/video/video_container.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

namespace rotslam {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kNoTime = AV_NOPTS_VALUE;

}  // namespace

VideoFile::VideoFile(const fs::path& path, double fps, int num_threads) : path_(path) {
  QuietFfmpeg();
  OpenContainer();
  ChooseStream();
  form_ = "video (" + PlainName(avcodec_get_name(stream_->codecpar->codec_id));
  const std::string container = ContainerText(*container_, path_);
  form_ += form_ == "video (" + container ? ")" : " in " + container + ")";
  OpenDecoder(num_threads);
  ProbeTimestamps();
  DecodeFirstFrame();
  FindRate(fps);
  NoteWhatIsOdd();
  CollectMetadata();
  CountFrames();
}

void VideoFile::Fail(const std::string& reason) const {
  throw std::runtime_error(path_.string() + ": " + reason);
}

void VideoFile::OpenContainer() {
  ProbedFormat probed;
  const int error = OpenInputFile(path_, container_, probed);
  if (error == AVERROR_DEMUXER_NOT_FOUND) {
    Fail(std::string("not a video but, for FFmpeg, '") + probed.format->name +
         "'; give the video file itself, or the folder of the images");
  }
  if (error < 0) {
    if (probed.is_sure && IsMovie(*probed.format)) {
      Fail(
          "an MP4 or QuickTime file without its index (moov), which recorders write last: cut "
          "off or damaged; copy it once more from the camera");
    }
    if (error == AVERROR_INVALIDDATA || error == AVERROR_EOF) {
      Fail("not a video that FFmpeg can open, or cut off");
    }
    Fail("not a video that FFmpeg can open: " + ErrorText(error));
  }
  // What it cannot tell shows when frames are decoded.
  avformat_find_stream_info(container_.get(), nullptr);
}

void VideoFile::ChooseStream() {
  std::string others;
  std::string sound;
  for (unsigned k = 0; k < container_->nb_streams; ++k) {
    AVStream* stream = container_->streams[k];
    if (stream->codecpar->codec_type == AVMEDIA_TYPE_AUDIO && sound.empty()) {
      sound = avcodec_get_name(stream->codecpar->codec_id);
    }
    if (!IsFilm(*stream)) continue;
    if (stream_ == nullptr || PixelsOf(*stream) > PixelsOf(*stream_)) stream_ = stream;
  }
  if (stream_ == nullptr) {
    Fail("holds no video stream" + (sound.empty() ? std::string() : ", only sound: " + sound));
  }
  for (unsigned k = 0; k < container_->nb_streams; ++k) {
    AVStream* stream = container_->streams[k];
    if (stream == stream_) continue;
    stream->discard = AVDISCARD_ALL;
    if (IsFilm(*stream)) others += (others.empty() ? "" : ", ") + StreamText(*stream);
  }
  if (!others.empty()) {
    notes_.push_back("of several video streams the largest is read, " + StreamText(*stream_) +
                     "; left out: " + others);
  }
}

void VideoFile::OpenDecoder(int num_threads) {
  const AVCodecParameters& parameters = *stream_->codecpar;
  const std::string name = avcodec_get_name(parameters.codec_id);
  const AVCodec* decoder = avcodec_find_decoder(parameters.codec_id);
  if (decoder == nullptr) {
    Fail("FFmpeg has no decoder for " + name +
         " here; convert the video where it has: ffmpeg -i VIDEO -c:v libx264 -crf 16 out.mp4");
  }
  codec_.reset(avcodec_alloc_context3(decoder));
  if (codec_ == nullptr || avcodec_parameters_to_context(codec_.get(), &parameters) < 0) {
    Fail("video without a readable frame: the parameters of " + name + " are damaged");
  }
  codec_->pkt_timebase = stream_->time_base;
  // What several threads make of a damaged frame, and of those that refer to it, differs from time
  // to time.
  codec_->thread_count = num_threads;
  // What a damaged header may ask for: no more than 16K video, and no more than the file is worth.
  // 4K video of one colour comes to some 2,800 pixels a byte.
  constexpr std::int64_t kMostPixels = std::int64_t{1} << 27;
  constexpr std::int64_t kFreePixels = std::int64_t{1} << 22;
  constexpr std::int64_t kPixelsPerByte = 4096;
  const std::int64_t file_size = std::max<std::int64_t>(0, avio_size(container_->pb));
  codec_->max_pixels = file_size < kMostPixels / kPixelsPerByte
                           ? std::min(kMostPixels, kFreePixels + kPixelsPerByte * file_size)
                           : kMostPixels;
  const int error = avcodec_open2(codec_.get(), decoder, nullptr);
  if (error < 0) Fail("video without a readable frame: " + name + ", " + ErrorText(error));
  picture_.reset(av_frame_alloc());
  if (picture_ == nullptr) throw std::bad_alloc();
}

// Are there timestamps, and do they tell frames apart? Packets tell, before any is decoded.
void VideoFile::ProbeTimestamps() {
  constexpr std::size_t kProbed = 16;
  const AVInputFormat& format = *container_->iformat;
  if (IsBareStream(format) || (format.flags & AVFMT_NOTIMESTAMPS) != 0) {
    has_timestamps_ = false;
    return;
  }
  while (packets_.size() < kProbed) {
    FfmpegPointer<AVPacket> packet = ReadPacket();
    if (packet == nullptr) break;
    packets_.push_back(std::move(packet));
  }
  std::set<std::int64_t> times;
  for (const auto& packet : packets_) {
    const std::int64_t time = packet->pts != kNoTime ? packet->pts : packet->dts;
    if (time != kNoTime) times.insert(time);
  }
  has_timestamps_ = !times.empty() && 2 * times.size() >= packets_.size();
}

// The next packet of the stream; nullptr after the last.
FfmpegPointer<AVPacket> VideoFile::ReadPacket() {
  constexpr int kMostFailures = 100;
  FfmpegPointer<AVPacket> packet(av_packet_alloc());
  if (packet == nullptr) throw std::bad_alloc();
  for (int failures = 0; failures < kMostFailures;) {
    const int error = av_read_frame(container_.get(), packet.get());
    if (error == AVERROR_EOF) return nullptr;
    if (error < 0) {
      ++failures;
      continue;
    }
    if (packet->stream_index == stream_->index) return packet;
    av_packet_unref(packet.get());
  }
  return nullptr;
}

// As ReadPacket, but without a last one that is cut off.
FfmpegPointer<AVPacket> VideoFile::NextPacket() {
  if (packets_.empty()) {
    FfmpegPointer<AVPacket> packet = ReadPacket();
    if (packet == nullptr) return nullptr;
    packets_.push_back(std::move(packet));
  }
  if ((packets_.front()->flags & AV_PKT_FLAG_CORRUPT) != 0 && packets_.size() == 1) {
    FfmpegPointer<AVPacket> following = ReadPacket();
    if (following == nullptr) {
      is_cut_off_ = true;
      packets_.clear();
      return nullptr;
    }
    packets_.push_back(std::move(following));
  }
  FfmpegPointer<AVPacket> packet = std::move(packets_.front());
  packets_.pop_front();
  return packet;
}

void VideoFile::FeedDecoder() {
  constexpr std::size_t kMostPending = 1000;
  const FfmpegPointer<AVPacket> packet = NextPacket();
  if (packet == nullptr) {
    is_drained_ = true;
    avcodec_send_packet(codec_.get(), nullptr);
    return;
  }
  if (has_timestamps_ && packet->pts != kNoTime && (packet->flags & AV_PKT_FLAG_DISCARD) == 0) {
    pending_.insert(packet->pts);
    if (pending_.size() > kMostPending) pending_.erase(pending_.begin());
  }
  if (avcodec_send_packet(codec_.get(), packet.get()) < 0) ++num_errors_;
}

// Decodes up to the next picture; false after the last.
bool VideoFile::ReceivePicture() {
  constexpr int kMostFailures = 1000;  // of a decoder that is only to be emptied
  for (int failures = 0; failures < kMostFailures;) {
    const int error = avcodec_receive_frame(codec_.get(), picture_.get());
    if (error >= 0) return true;
    if (error == AVERROR_EOF) return false;
    if (error != AVERROR(EAGAIN)) ++num_errors_;
    if (is_drained_) {
      ++failures;
    } else {
      FeedDecoder();
    }
  }
  return false;
}

// Frames come in the order of presentation: what is pending and earlier than `shown` comes no more.
// Only errors make frames lost; there are packets that hold none.
void VideoFile::CollectLost(std::int64_t shown) {
  while (!pending_.empty() && *pending_.begin() < shown) {
    if (num_errors_ > 0) {
      lost_.push_back(*pending_.begin());
      --num_errors_;
    }
    pending_.erase(pending_.begin());
  }
  pending_.erase(shown);
}

void VideoFile::DecodeFirstFrame() {
  if (!ReceivePicture()) {
    Fail("video without a readable frame (" + form_.substr(std::strlen("video (")));
  }
  const std::int64_t shown = picture_->best_effort_timestamp;
  const auto num_before = std::count_if(pending_.begin(), pending_.end(), [&](std::int64_t time) {
    return shown != kNoTime && time < shown;
  });
  num_left_out_ = num_before;
  if (num_before > 0) {
    notes_.push_back("the first " + CountText(num_before, "frame") +
                     " cannot be decoded without the key frame before; frames are numbered from "
                     "the first that can");
  }
  num_errors_ = 0;
  CollectLost(shown != kNoTime ? shown : std::numeric_limits<std::int64_t>::min());
  // Where only the order of decoding has times, the first one shown is their zero.
  const bool is_own = picture_->pts != kNoTime && stream_->start_time != kNoTime;
  start_ticks_ = is_own ? stream_->start_time : (shown != kNoTime ? shown : 0);
  picture_waits_ = true;

  const std::optional<DisplayMatrix> matrix = FindDisplayMatrix(*picture_, *stream_);
  const cv::Size stored(picture_->width, picture_->height);
  if (matrix) {
    if (const auto orientation = OrientationOf(*matrix)) {
      orientation_ = *orientation;
    } else {
      const double angle = -av_display_rotation_get(matrix->data());
      notes_.push_back(
          std::isfinite(angle)
              ? "the display matrix turns pictures by " +
                    NumberText(std::round(10.0 * angle) / 10.0) +
                    " degrees, which is no right angle: they are taken as stored"
              : std::string("the display matrix is singular: pictures are taken as stored"));
    }
  } else if (const AVDictionaryEntry* tag = av_dict_get(stream_->metadata, "rotate", nullptr, 0);
             tag != nullptr && std::string_view(tag->value) != "0") {
    notes_.push_back(std::string("the tag rotate=") + tag->value +
                     " is ignored, as by ffmpeg: there is no display matrix");
  }
  image_size_ = orientation_.is_transposed ? cv::Size(stored.height, stored.width) : stored;
  if (!orientation_.IsAsStored()) {
    notes_.push_back("pictures are " + Describe(orientation_) +
                     ", as the display matrix asks: " + VideoSizeText(stored.width, stored.height) +
                     " stored, " + VideoSizeText(image_size_.width, image_size_.height) +
                     " shown; the first stored row is shown at the " + Name(readout_from()));
  }
}

void VideoFile::FindRate(double fps) {
  if (has_timestamps_) {
    const AVRational rate = stream_->r_frame_rate;
    rate_ = rate.num > 0 && rate.den > 0 ? av_q2d(rate) : fps;
    if (!(rate_ > 0.0) || rate_ > 1000.0) rate_ = fps;
    times_source_ = "timestamps of the video";
    return;
  }
  // A bare stream has no timestamps; FFmpeg makes them up at 25 frames a second. The rate that the
  // decoder read in it is the encoder's word.
  const AVRational rate = codec_->framerate;
  const bool says_rate = rate.num > 0 && rate.den > 0 && av_q2d(rate) < 1000.0;
  rate_ = says_rate ? av_q2d(rate) : fps;
  times_source_ = "made up at " + NumberText(rate_) + " frames a second" +
                  (says_rate ? ", the rate that the stream says" : "");
}

void VideoFile::NoteWhatIsOdd() {
  if (IsInterlaced(*picture_)) {
    notes_.push_back(
        "the video is interlaced: each frame holds two moments, which turns tear apart; "
        "deinterlace "
        "it first: ffmpeg -i VIDEO -vf yadif -crf 16 out.mp4");
  }
  const AVRational pixel = av_guess_sample_aspect_ratio(container_.get(), stream_, picture_.get());
  if (pixel.num > 0 && pixel.den > 0 && pixel.num != pixel.den) {
    const double ratio = av_q2d(orientation_.is_transposed ? av_inv_q(pixel) : pixel);
    notes_.push_back(
        "pixels are not square, " + RatioText(pixel) +
        " as stored: pictures are taken pixel by pixel, and the camera's fy is about " +
        NumberText(ratio) + " fx");
  }
  const AVPixFmtDescriptor* format =
      av_pix_fmt_desc_get(static_cast<AVPixelFormat>(picture_->format));
  if (format != nullptr && format->comp[0].depth > 8) {
    const bool is_hdr =
        picture_->color_trc == AVCOL_TRC_SMPTE2084 || picture_->color_trc == AVCOL_TRC_ARIB_STD_B67;
    notes_.push_back(std::string(is_hdr ? "HDR video of " : "video of ") +
                     std::to_string(format->comp[0].depth) + " bits is scaled to 8" +
                     (is_hdr ? ", without tone mapping" : ""));
  }
}

void VideoFile::CollectMetadata() {
  AddTags(stream_->metadata, metadata_);
  AddTags(container_->metadata, metadata_);
}

void VideoFile::CountFrames() {
  // Of larger files the packets take too long to be read twice.
  constexpr std::int64_t kMostBytesToCount = std::int64_t{1} << 30;
  constexpr double kMostFrames = 1e9;
  num_announced_ = stream_->nb_frames > 0 ? stream_->nb_frames : -1;
  const int num_indexed = avformat_index_get_entries_count(stream_);
  if (IsMovie(*container_->iformat) && num_announced_ > 0 && num_indexed > 0) {
    // An edit list may leave frames out.
    num_announced_ = 0;
    for (int k = 0; k < num_indexed; ++k) {
      const AVIndexEntry* entry = avformat_index_get_entry(stream_, k);
      if ((entry->flags & AVINDEX_DISCARD_FRAME) == 0) ++num_announced_;
    }
  }
  std::error_code ignored;
  if (num_announced_ < 0 && fs::is_regular_file(path_, ignored)) {
    if (avio_size(container_->pb) <= kMostBytesToCount) {
      num_announced_ = CountPackets(path_, stream_->index);
    } else if (container_->duration > 0) {
      const AVRational rate = av_guess_frame_rate(container_.get(), stream_, nullptr);
      const double seconds = static_cast<double>(container_->duration) / AV_TIME_BASE;
      if (rate.num > 0 && rate.den > 0) {
        num_announced_ = std::llround(std::min(kMostFrames, seconds * av_q2d(rate)));
      }
    }
  }
  num_announced_ -= num_left_out_;
  if (num_announced_ <= 0 || static_cast<double>(num_announced_) >= kMostFrames) {
    num_announced_ = -1;
  }
}

// Gives the next frame its time: its own one where that is later than the one before.
void VideoFile::SetTime(std::int64_t ticks) {
  const bool is_first = number_ == 0;
  ++number_;
  if (!has_timestamps_) {
    time_s_ = static_cast<double>(number_ - 1) / rate_;
    return;
  }
  if (ticks != kNoTime) {
    // As doubles: differences of what damaged files say may be beyond 64 bits.
    const double since_start = static_cast<double>(ticks) - static_cast<double>(start_ticks_);
    const double own_s = since_start * stream_->time_base.num / stream_->time_base.den;
    // A clock that was set back goes on from there; a single wrong timestamp changes nothing.
    if (suspect_s_ && own_s + offset_s_ <= time_s_ && own_s > *suspect_s_) {
      offset_s_ = time_s_ - *suspect_s_;
    }
    if (is_first || own_s + offset_s_ > time_s_) {
      suspect_s_.reset();
      time_s_ = own_s + offset_s_;
      return;
    }
    suspect_s_ = own_s;
  }
  // An AVI file numbers packets, not frames: the last ones of a decoder that reorders have none.
  if (ticks != kNoTime || !is_drained_) ++num_without_time_;
  time_s_ = is_first ? 0.0 : time_s_ + 1.0 / rate_;
}

void VideoFile::Finish() {
  has_ended_ = true;
  has_picture_ = false;
  if (is_cut_off_) notes_.emplace_back("the last frame of the file is cut off and left out");
  if (num_without_time_ > 0) {
    notes_.push_back("of " + CountText(num_without_time_, "frame") +
                     " the time was missing or not later than the one before, and is made up");
  }
}

// Steps to the next frame: one that is lost, or a picture.
bool VideoFile::Step() {
  if (lost_.empty() && !picture_waits_) {
    if (ReceivePicture()) {
      picture_waits_ = true;
      if (const std::int64_t shown = picture_->best_effort_timestamp; shown != kNoTime) {
        CollectLost(shown);
      }
    } else {
      CollectLost(std::numeric_limits<std::int64_t>::max());
    }
  }
  has_picture_ = false;
  if (!lost_.empty()) {
    SetTime(lost_.front());
    lost_.pop_front();
    return true;
  }
  if (!picture_waits_) return false;
  picture_waits_ = false;
  has_picture_ = true;
  SetTime(picture_->best_effort_timestamp);
  return true;
}

bool VideoFile::Grab() {
  if (has_ended_) return false;
  if (Step()) return true;
  Finish();
  return false;
}

DecodedImage VideoFile::Retrieve() {
  DecodedImage decoded;
  if (!has_picture_) {
    decoded.problem = "frame of the video cannot be decoded";
    return decoded;
  }
  has_picture_ = false;
  decoded.problem = DamageOf(*picture_);
  if (!decoded.problem.empty()) return decoded;
  const int width = picture_->width;
  const int rows = RowsToConvert(*picture_, *codec_);
  const auto format = static_cast<AVPixelFormat>(picture_->format);
  // The same conversion as OpenCV's.
  scaler_.reset(sws_getCachedContext(scaler_.release(),
                                     width,
                                     rows,
                                     format,
                                     width,
                                     rows,
                                     AV_PIX_FMT_BGR24,
                                     SWS_BICUBIC,
                                     nullptr,
                                     nullptr,
                                     nullptr));
  if (scaler_ == nullptr) {
    const char* name = av_get_pix_fmt_name(format);
    decoded.problem = std::string("pixels of the form ") + (name == nullptr ? "?" : name) +
                      " cannot be converted";
    return decoded;
  }
  // Fast conversions write whole blocks of pixels, also at the end of the last row.
  constexpr int kBlock = 16;
  const cv::Rect visible(0, 0, width, picture_->height);
  cv::Mat padded(rows + 1, (width + kBlock - 1) / kBlock * kBlock, CV_8UC3);
  const std::array<std::uint8_t*, 4> data = {padded.data, nullptr, nullptr, nullptr};
  const std::array<int, 4> strides = {static_cast<int>(padded.step[0]), 0, 0, 0};
  if (sws_scale(
          scaler_.get(), picture_->data, picture_->linesize, 0, rows, data.data(), strides.data()) <
      0) {
    decoded.problem = "frame of the video cannot be converted";
    return decoded;
  }
  const cv::Mat image = Upright(padded(visible), orientation_);
  // Without the padding's memory and rows that lie apart.
  decoded.image = image.isContinuous() ? image : image.clone();
  return decoded;
}

}  // namespace rotslam
