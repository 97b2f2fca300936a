#pragma once

#include <memory>
#include <set>
#include <string>

#include "apps/cli/terminal/interruption.h"
#include "apps/cli/terminal/progress.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"

namespace rotslam {

/// Writes the progress and the warnings of a run for a person. The constructor's arguments must
/// outlive it.
class SlamProgress : public SlamObserver {
 public:
  SlamProgress(const SlamOptions& options, const Interruption& interruption, Progress& progress);
  ~SlamProgress() override;

  void OnBegin(SlamStage stage, int num_steps) override;
  void OnFrame(const FrameProgress& progress) override;
  void OnReadoutFound(const ReadoutEstimate& readout) override;
  void OnMissingImage(const std::string& problem) override;
  void OnFocalPass(int pass, double focal_px) override;
  void OnEnd(SlamStage stage, const Orientations& orientations) override;
  void OnEnd(SlamStage stage, const MapResult& map) override;
  bool ShouldStop() override;

 private:
  class Counters;

  const SlamOptions& options_;
  const Interruption& interruption_;
  Progress& progress_;
  std::unique_ptr<Counters> counters_;  // of the stage at hand
  std::set<FrameId> unreadable_;        // frames that have had a warning
  int num_announced_ = -1;              // frames
};

}  // namespace rotslam
