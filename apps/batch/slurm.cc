#include "apps/batch/slurm.h"

namespace rotslam {
namespace {

// The text as a shell takes it literally.
std::string Quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

}  // namespace

std::string SlurmScript(const SlurmJob& job) {
  const std::string threads = std::to_string(job.num_threads);
  std::string script =
      "#!/bin/bash\n"
      "# One task per sequence of $list, independent of each other; those that are done are "
      "skipped.\n"
      "# Submit with sbatch. When all have ended: rotslam batch \"$list\" --collect --out "
      "\"$out\"\n"
      "#SBATCH --job-name=rotslam\n"
      "#SBATCH --array=1-" +
      std::to_string(job.num_sequences) +
      (job.max_running > 0 ? "%" + std::to_string(job.max_running) : "") +
      "\n#SBATCH --cpus-per-task=" + threads + "\n";
  for (const std::string& option : job.options) script += "#SBATCH " + option + "\n";
  script +=
      "# What a task prints goes to $out/slurm, see below.\n"
      "#SBATCH --output=/dev/null\n\n";
  script += "program=" + Quoted(job.program) + "\nlist=" + Quoted(job.list) +
            "\nout=" + Quoted(job.out) + "\noptions=(--seed " + job.seed + " --checkpoint-every " +
            std::to_string(job.checkpoint_every);
  if (!job.config.empty()) script += " --config " + Quoted(job.config);
  script +=
      ")\n\nset -eu\n"
      "task=${SLURM_ARRAY_TASK_ID:?is set by sbatch for each task of an array}\n"
      "mkdir -p \"$out/slurm\"\n"
      "exec >\"$out/slurm/$task.txt\" 2>&1\n"
      "exec \"$program\" batch \"$list\" --only \"$task\" --out \"$out\" "
      "--threads \"${SLURM_CPUS_PER_TASK:-" +
      threads + "}\" \"${options[@]}\"\n";
  return script;
}

}  // namespace rotslam
