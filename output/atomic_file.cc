#include "output/atomic_file.h"

#include <cerrno>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <system_error>

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

}  // namespace

void ReplaceFile(const std::filesystem::path& path,
                 const std::function<void(const std::filesystem::path& temporary)>& write) {
  std::filesystem::path temporary = path;
  temporary += ".tmp";
  std::error_code error;
  try {
    write(temporary);
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
