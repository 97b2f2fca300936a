#pragma once

#include <filesystem>

namespace rotslam {

/// Folder in a run's folder that is there only as long as the run is unfinished.
std::filesystem::path UnfinishedFolder(const std::filesystem::path& run);

/// Where a run puts its files together until all are there: the folder of the run keeps what it had
/// before, complete, until then. `summary.json` is to be written last and says that all are there.
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

/// What a run killed in the middle of it had still to publish is published, what a run killed
/// before it has left is removed. A checkpoint stays.
void ClearUnfinishedOutputs(const std::filesystem::path& run);

}  // namespace rotslam
