#pragma once

#include <string>
#include <vector>

namespace rotslam {

/// A batch as an array job of Slurm, one independent task per sequence. Paths absolute.
struct SlurmJob {
  std::string program;
  std::string list;
  std::string out;
  std::string config;  // as --config; empty: none
  std::string seed;
  int checkpoint_every = 0;
  int num_sequences = 0;
  int max_running = 0;               // tasks at a time; 0: as many as the cluster gives
  int num_threads = 1;               // cores of a task
  std::vector<std::string> options;  // of sbatch, one each: "--time=2:00:00"
};

/// The script for `sbatch`. It also runs without Slurm: SLURM_ARRAY_TASK_ID=2 bash FILE.
/// Paths may hold any character but a zero byte: they stand between single quotes, and in none of
/// the lines that sbatch reads itself.
std::string SlurmScript(const SlurmJob& job);

}  // namespace rotslam
