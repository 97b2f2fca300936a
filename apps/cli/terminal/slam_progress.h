#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "apps/cli/terminal/interruption.h"
#include "apps/cli/terminal/progress.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "apps/slam/working_size/working_size.h"
#include "ba/bundle_adjustment.h"

namespace rotslam {

/// Writes the progress and the warnings of a run for a person. The constructor's arguments must
/// outlive it. It is told what is worked with, and says pixels of the original images.
class SlamProgress : public SlamObserver {
 public:
  SlamProgress(const SlamOptions& options,
               const WorkingSize& working,
               const Interruption& interruption,
               Progress& progress);
  ~SlamProgress() override;

  void OnBegin(SlamStage stage, int num_steps) override;
  void OnFrame(const FrameProgress& progress) override;
  void OnReadoutFound(const ReadoutEstimate& readout) override;
  void OnStaticContent(const StaticContent& content) override;
  void OnMissingImage(const std::string& problem) override;
  void OnLensRound(int round, const Camera& camera) override;
  void OnEnd(SlamStage stage, const Orientations& orientations) override;
  void OnEnd(SlamStage stage, const MapResult& map) override;
  bool ShouldStop() override;

 private:
  class Counters;

  std::vector<BundleSummary> OriginalBundles(std::vector<BundleSummary> bundles) const;

  const SlamOptions& options_;
  const WorkingSize& working_;
  const Interruption& interruption_;
  Progress& progress_;
  std::unique_ptr<Counters> counters_;  // of the stage at hand
  std::set<FrameId> unreadable_;        // frames that have had a warning
  int num_announced_ = -1;              // frames
};

}  // namespace rotslam
