#include "rotodom/sequence/bag/decompress.h"

#include <algorithm>
#include <memory>
#include <stdexcept>

#ifdef ROTSLAM_HAVE_BZIP2
#include <bzlib.h>
#endif
#ifdef ROTSLAM_HAVE_LZ4
#include <lz4frame.h>
#endif
#ifdef ROTSLAM_HAVE_ZSTD
#include <zstd.h>
#endif

namespace rotslam {
namespace {

constexpr std::uint64_t kMostRawBytes = std::uint64_t{1} << 31;

// Room for what comes out: doubled whenever it is full, up to `limit` and one byte, which shows
// that there is more.
class GrowingOutput {
 public:
  explicit GrowingOutput(std::uint64_t limit) : limit_(limit + 1) { Grow(); }

  char* next() { return bytes_.data() + used_; }
  std::size_t room() const { return bytes_.size() - used_; }

  // Notes that `count` bytes were written; false when the limit is passed.
  bool Wrote(std::size_t count) {
    used_ += count;
    if (used_ >= limit_) return false;
    if (used_ == bytes_.size()) Grow();
    return true;
  }

  std::size_t size() const { return used_; }

  std::string Finish() {
    bytes_.resize(used_);
    return std::move(bytes_);
  }

 private:
  void Grow() {
    constexpr std::uint64_t kFirstSize = std::uint64_t{1} << 16;
    const std::uint64_t wanted = std::max(kFirstSize, std::uint64_t{2} * bytes_.size());
    bytes_.resize(static_cast<std::size_t>(std::min(wanted, limit_)));
  }

  std::uint64_t limit_;
  std::size_t used_ = 0;
  std::string bytes_;
};

[[noreturn, maybe_unused]] void FailWithout(const std::string& compression,
                                            const std::string& package) {
  throw std::runtime_error("is compressed with " + compression +
                           ", and this program was built without it; install " + package +
                           " and build again");
}

[[noreturn, maybe_unused]] void FailDamaged(const std::string& compression) {
  throw std::runtime_error(compression + " data are damaged");
}

#ifdef ROTSLAM_HAVE_BZIP2
std::string DecompressBzip2(std::string_view packed, std::uint64_t raw_size) {
  bz_stream stream = {};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) FailDamaged("bz2");
  const std::unique_ptr<bz_stream, int (*)(bz_stream*)> guard(&stream, BZ2_bzDecompressEnd);
  GrowingOutput output(raw_size);
  // It does not write to its input.
  stream.next_in = const_cast<char*>(packed.data());
  stream.avail_in = static_cast<unsigned>(packed.size());
  for (;;) {
    stream.next_out = output.next();
    const auto room = static_cast<unsigned>(output.room());
    stream.avail_out = room;
    const int status = BZ2_bzDecompress(&stream);
    const std::size_t count = room - stream.avail_out;
    const bool goes_on = output.Wrote(count);
    if (status == BZ_STREAM_END) break;
    if (status != BZ_OK || !goes_on || (count == 0 && stream.avail_in == 0)) FailDamaged("bz2");
  }
  return output.Finish();
}
#endif

#ifdef ROTSLAM_HAVE_LZ4
std::string DecompressLz4(std::string_view packed, std::uint64_t raw_size) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) FailDamaged("lz4");
  const std::unique_ptr<LZ4F_dctx, LZ4F_errorCode_t (*)(LZ4F_dctx*)> guard(
      context, LZ4F_freeDecompressionContext);
  GrowingOutput output(raw_size);
  for (;;) {
    std::size_t written = output.room();
    std::size_t read = packed.size();
    const std::size_t status =
        LZ4F_decompress(context, output.next(), &written, packed.data(), &read, nullptr);
    if (LZ4F_isError(status)) FailDamaged("lz4");
    packed.remove_prefix(read);
    const bool goes_on = output.Wrote(written);
    if (status == 0) break;
    if (!goes_on || (written == 0 && read == 0)) FailDamaged("lz4");
  }
  return output.Finish();
}
#endif

#ifdef ROTSLAM_HAVE_ZSTD
// The first frame, or its beginning when `may_stop` says that the limit is enough.
std::string DecompressZstd(std::string_view packed, std::uint64_t raw_size, bool may_stop) {
  const std::unique_ptr<ZSTD_DCtx, std::size_t (*)(ZSTD_DCtx*)> context(ZSTD_createDCtx(),
                                                                        ZSTD_freeDCtx);
  GrowingOutput output(raw_size);
  ZSTD_inBuffer input = {packed.data(), packed.size(), 0};
  for (;;) {
    ZSTD_outBuffer room = {output.next(), output.room(), 0};
    const std::size_t input_before = input.pos;
    const std::size_t status = ZSTD_decompressStream(context.get(), &room, &input);
    if (ZSTD_isError(status)) FailDamaged("zstd");
    const bool goes_on = output.Wrote(room.pos);
    if (status == 0) break;
    if (!goes_on && may_stop) break;
    if (!goes_on || (room.pos == 0 && input.pos == input_before)) FailDamaged("zstd");
  }
  return output.Finish();
}
#endif

}  // namespace

bool CanDecompress([[maybe_unused]] std::string_view compression) {
#ifdef ROTSLAM_HAVE_BZIP2
  if (compression == "bz2") return true;
#endif
#ifdef ROTSLAM_HAVE_LZ4
  if (compression == "lz4") return true;
#endif
#ifdef ROTSLAM_HAVE_ZSTD
  if (compression == "zstd") return true;
#endif
  return false;
}

std::string Decompress(std::string_view compression,
                       std::string_view packed,
                       std::uint64_t raw_size) {
  const std::string name(compression);
  if (raw_size > kMostRawBytes || packed.size() > kMostRawBytes) {
    throw std::runtime_error("claims " + std::to_string(raw_size) +
                             " bytes, more than the 2 GiB that are read at once");
  }
  std::string bytes;
  if (compression == "bz2") {
#ifdef ROTSLAM_HAVE_BZIP2
    bytes = DecompressBzip2(packed, raw_size);
#else
    FailWithout(name, "libbz2-dev");
#endif
  } else if (compression == "lz4") {
#ifdef ROTSLAM_HAVE_LZ4
    bytes = DecompressLz4(packed, raw_size);
#else
    FailWithout(name, "liblz4-dev");
#endif
  } else if (compression == "zstd") {
#ifdef ROTSLAM_HAVE_ZSTD
    bytes = DecompressZstd(packed, raw_size, false);
#else
    FailWithout(name, "libzstd-dev");
#endif
  } else {
    throw std::runtime_error("compression '" + name + "' is not known; bz2, lz4 and zstd are");
  }
  if (bytes.size() != raw_size) {
    throw std::runtime_error(name + " data are damaged: " + std::to_string(bytes.size()) +
                             " bytes, " + std::to_string(raw_size) + " expected");
  }
  return bytes;
}

bool IsZstdFrame(std::string_view bytes) { return bytes.starts_with("\x28\xb5\x2f\xfd"); }

std::string DecompressMessage([[maybe_unused]] std::string_view packed,
                              [[maybe_unused]] std::uint64_t most_bytes) {
#ifdef ROTSLAM_HAVE_ZSTD
  const bool is_head = most_bytes < kMostRawBytes;
  return DecompressZstd(packed, std::min(most_bytes, kMostRawBytes), is_head);
#else
  FailWithout("zstd", "libzstd-dev");
#endif
}

}  // namespace rotslam
