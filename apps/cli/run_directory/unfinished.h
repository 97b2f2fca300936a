#pragma once

#include <filesystem>

namespace rotslam {

/// Folder in a run's folder that is there only as long as the run is unfinished.
std::filesystem::path UnfinishedFolder(const std::filesystem::path& run);

/// The folder in which a run collects its files until it has written all of them. Until then the
/// run's own folder keeps its older files. Write `summary.json` last: it says that all are there.
class UnfinishedOutputs {
 public:
  /// @param run  the run's folder.
  explicit UnfinishedOutputs(std::filesystem::path run);

  const std::filesystem::path& folder() const { return folder_; }

  /// Moves the files to the run's folder, in place of all that a run before has left there, exports
  /// and plots of it excepted. While this lasts, about a millisecond, there is no summary.json.
  /// Throws std::runtime_error with path and reason.
  void Publish() const;

 private:
  std::filesystem::path run_;
  std::filesystem::path folder_;
};

/// Tidies up after a killed run: files that it was publishing are published, files that it had only
/// collected are removed. A checkpoint stays.
void ClearUnfinishedOutputs(const std::filesystem::path& run);

}  // namespace rotslam
