#include "output/files/atomic_file.h"

#include <cerrno>
#include <cstdio>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

namespace rotslam {
namespace {

[[noreturn]] void Refuse(const std::filesystem::path& path, const std::string& reason) {
  throw std::runtime_error(path.string() + ": cannot write the file: " + reason);
}

// Plain C files: their calls leave the reason in errno, which streams do not promise.
void WriteWhole(const std::filesystem::path& path,
                const std::filesystem::path& temporary,
                std::string_view content) {
  std::FILE* file = std::fopen(temporary.c_str(), "wb");
  if (file == nullptr) Refuse(path, std::generic_category().message(errno));
  const bool wrote =
      content.empty() || std::fwrite(content.data(), 1, content.size(), file) == content.size();
  const int write_error = errno;
  const bool closed = std::fclose(file) == 0;
  if (!wrote) Refuse(path, std::generic_category().message(write_error));
  if (!closed) Refuse(path, std::generic_category().message(errno));
}

void Sync(const std::filesystem::path& path, const std::filesystem::path& temporary) {
  const int file = open(temporary.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) Refuse(path, std::generic_category().message(errno));
  const int error = fsync(file) == 0 ? 0 : errno;
  close(file);
  if (error != 0) Refuse(path, std::generic_category().message(error));
}

// The temporary files there are. Global, because who ends the program knows none of the writers.
struct TemporaryFiles {
  std::mutex mutex;
  std::multiset<std::filesystem::path> paths;
};

TemporaryFiles& Temporaries() {
  static auto* const temporaries = new TemporaryFiles;  // outlives every thread
  return *temporaries;
}

class TemporaryFile {
 public:
  explicit TemporaryFile(const std::filesystem::path& path) {
    const std::scoped_lock lock(Temporaries().mutex);
    entry_ = Temporaries().paths.insert(path);
  }
  ~TemporaryFile() {
    const std::scoped_lock lock(Temporaries().mutex);
    Temporaries().paths.erase(entry_);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

 private:
  std::multiset<std::filesystem::path>::iterator entry_;
};

}  // namespace

void RemoveTemporaryFiles() {
  Temporaries().mutex.lock();
  std::error_code error;
  for (const std::filesystem::path& path : Temporaries().paths) {
    std::filesystem::remove(path, error);
  }
}

void ReplaceFile(const std::filesystem::path& path,
                 const std::function<void(const std::filesystem::path& temporary)>& write) {
  std::filesystem::path temporary = path;
  temporary += ".tmp";
  const TemporaryFile registered(temporary);
  std::error_code error;
  // Whatever stands there is not ours: through a link, it would be written to somewhere else.
  std::filesystem::remove(temporary, error);
  try {
    write(temporary);
    Sync(path, temporary);
    std::filesystem::rename(temporary, path, error);
    if (error) Refuse(path, error.message());
  } catch (...) {
    std::filesystem::remove(temporary, error);
    throw;
  }
}

void ReplaceFile(const std::filesystem::path& path, std::string_view content) {
  ReplaceFile(
      path, [&](const std::filesystem::path& temporary) { WriteWhole(path, temporary, content); });
}

}  // namespace rotslam
