#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

namespace rotslam {

/// Writes a file so that nobody ever sees half of it: `write` fills `path` + ".tmp" in the same
/// folder, which is then renamed to `path`. When anything fails the temporary file is removed and
/// an older `path` stays as it was. The content is on the disk before the name is, so that this
/// also holds when the machine stops.
/// Throws std::runtime_error naming `path` and the reason when the disk or the permissions refuse;
/// what `write` throws passes through.
void ReplaceFile(const std::filesystem::path& path,
                 const std::function<void(const std::filesystem::path& temporary)>& write);

/// The same for content already in memory.
void ReplaceFile(const std::filesystem::path& path, std::string_view content);

/// For a program that is about to end while other threads write: removes the temporary files there
/// are. Afterwards every ReplaceFile waits for ever.
void RemoveTemporaryFiles();

}  // namespace rotslam
