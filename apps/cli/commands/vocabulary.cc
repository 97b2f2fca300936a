#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "apps/cli/command.h"
#include "apps/cli/terminal/progress.h"
#include "output/files/atomic_file.h"
#include "rotodom/features/features.h"
#include "rotodom/loop/default_vocabulary.h"
#include "rotodom/loop/training.h"
#include "rotodom/loop/vocabulary_file.h"
#include "rotodom/sequence/image_file.h"
#include "rotodom/sequence/sequence_form.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

struct VocabularyFlags {
  CommonFlags common;
  std::vector<std::string> images;
  std::string in;  // info: empty stands for the one in the program
  std::string out;
  std::string format;  // empty: by the name of `out`
  int stride = 1;
  FeatureOptions features;
  TrainingOptions training;
};

void RefuseConfig(const VocabularyFlags& flags) {
  if (flags.common.config.empty()) return;
  throw std::invalid_argument(
      "vocabulary takes its options from the command line, not from --config");
}

// Asked before the work: training may take minutes.
void CheckOutFolder(const std::filesystem::path& out) {
  const std::filesystem::path folder = out.has_parent_path() ? out.parent_path() : ".";
  if (!std::filesystem::is_directory(folder)) {
    throw std::runtime_error(out.string() + ": its folder does not exist; make it first");
  }
}

std::size_t WriteVocabulary(const Vocabulary& vocabulary, const VocabularyFlags& flags) {
  const std::filesystem::path out = flags.out;
  const bool is_text = flags.format.empty() ? out.extension() == ".txt" : flags.format == "text";
  const std::string bytes = is_text ? EncodeText(vocabulary) : EncodeBinary(vocabulary);
  ReplaceFile(out, bytes);
  return bytes.size();
}

// ---- train

std::vector<std::filesystem::path> ListImages(const VocabularyFlags& flags) {
  std::vector<std::filesystem::path> images;
  for (const std::string& name : flags.images) {
    if (!std::filesystem::is_directory(name)) {
      images.emplace_back(name);
      continue;
    }
    const Layout layout = FindLayout(name, {});
    for (std::size_t k = 0; k < layout.entries.size();
         k += static_cast<std::size_t>(flags.stride)) {
      images.push_back(layout.entries[k].file);
    }
  }
  return images;
}

// Only its size matters: every bearing exists.
Camera NeutralCamera(const cv::Mat& image) {
  Camera camera;
  camera.width = image.cols;
  camera.height = image.rows;
  camera.fx = camera.fy = image.cols;
  camera.cx = 0.5 * (image.cols - 1);
  camera.cy = 0.5 * (image.rows - 1);
  return camera;
}

std::vector<BinaryDescriptor> DescribeImage(const std::filesystem::path& file,
                                            const FeatureOptions& options) {
  const auto [image, problem] = ReadImageFile(file);
  if (!problem.empty()) {
    throw std::runtime_error(file.string() + ": " + problem + "; name images or folders of them");
  }
  const Features features = ExtractFeatures(image, FrameId{0}, NeutralCamera(image), options, 1);
  return ToBinaryDescriptors(features.descriptors);
}

std::vector<std::vector<BinaryDescriptor>> DescribeImages(
    const std::vector<std::filesystem::path>& images,
    const VocabularyFlags& flags,
    Progress& progress) {
  constexpr int kBatch = 32;  // between two signs of life
  const int count = static_cast<int>(images.size());
  std::vector<std::vector<BinaryDescriptor>> descriptors(images.size());
  progress.StartStage("features", count);
  for (int begin = 0; begin < count; begin += kBatch) {
    const int end = std::min(begin + kBatch, count);
    ParallelFor(end - begin, flags.common.NumThreads(), [&](int k) {
      descriptors[begin + k] = DescribeImage(images[begin + k], flags.features);
    });
    progress.Step(end);
  }
  progress.EndStage();
  return descriptors;
}

int Train(VocabularyFlags flags) {
  const auto start = std::chrono::steady_clock::now();
  RefuseConfig(flags);
  CheckOutFolder(flags.out);
  flags.training.seed = flags.common.seed;
  if (const auto problem = flags.training.Problem()) throw std::invalid_argument(*problem);
  if (const auto problem = flags.features.Problem()) throw std::invalid_argument(*problem);
  const std::vector<std::filesystem::path> images = ListImages(flags);
  if (images.size() < 2) {
    throw std::invalid_argument("vocabulary train: one image is not enough; name at least two");
  }
  Progress progress(flags.common);
  const auto descriptors = DescribeImages(images, flags, progress);
  progress.StartStage("clustering", flags.training.depth);
  const Vocabulary vocabulary =
      TrainVocabulary(descriptors, flags.training, flags.common.NumThreads(), [&](int level, int) {
        progress.Step(level);
      });
  progress.EndStage();
  const std::size_t num_bytes = WriteVocabulary(vocabulary, flags);
  if (flags.common.quiet) return 0;
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  std::printf("wrote %s: %d words from %zu images, %zu bytes, %.1f s\n",
              flags.out.c_str(),
              vocabulary.num_words(),
              images.size(),
              num_bytes,
              seconds.count());
  return 0;
}

// ---- info and convert

int PrintInfo(const VocabularyFlags& flags) {
  RefuseConfig(flags);
  const Vocabulary vocabulary = flags.in.empty() ? DefaultVocabulary() : ReadVocabulary(flags.in);
  const VocabularyTree& tree = vocabulary.tree();
  std::printf("file       %s\n", flags.in.empty() ? "the one in this program" : flags.in.c_str());
  std::printf("bytes      %zu\n",
              flags.in.empty() ? EncodeBinary(vocabulary).size()
                               : static_cast<std::size_t>(std::filesystem::file_size(flags.in)));
  std::printf("branching  %d\ndepth      %d\n", tree.branching, tree.depth);
  std::printf("nodes      %zu\nwords      %d\n", tree.num_children.size(), vocabulary.num_words());
  std::printf("weighting  %s\nscoring    L1_NORM\n", Name(tree.weighting));
  return 0;
}

int Convert(const VocabularyFlags& flags) {
  RefuseConfig(flags);
  CheckOutFolder(flags.out);
  const Vocabulary vocabulary = ReadVocabulary(flags.in);
  const std::size_t num_bytes = WriteVocabulary(vocabulary, flags);
  if (flags.common.quiet) return 0;
  std::printf(
      "wrote %s: %d words, %zu bytes\n", flags.out.c_str(), vocabulary.num_words(), num_bytes);
  return 0;
}

void AddOutFlags(CLI::App& command, VocabularyFlags& flags) {
  command.add_option("--out", flags.out, "File to write")->required();
  command
      .add_option("--format",
                  flags.format,
                  "binary (small, loads at once) or text (as ORB-SLAM's ORBvoc.txt); default: text "
                  "where the name ends with .txt, else binary")
      ->check(CLI::IsMember({"binary", "text"}));
}

void AddTrainCommand(CLI::App& app, const std::shared_ptr<VocabularyFlags>& flags, Action& action) {
  CLI::App* command = app.add_subcommand("train", "Cluster the features of images into words");
  command->add_option("images", flags->images, "Images, folders of images, sequences")->required();
  AddOutFlags(*command, *flags);
  command->add_option("--stride", flags->stride, "Take every so manieth image of each folder")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command->add_option("--max-features", flags->features.max_features, "Features of an image")
      ->capture_default_str();
  command->add_option("--branching", flags->training.branching, "Children of a node (k)")
      ->capture_default_str();
  command->add_option("--depth", flags->training.depth, "Levels of the tree (L)")
      ->capture_default_str();
  command
      ->add_option("--min-descriptors",
                   flags->training.min_descriptors,
                   "Clusters with fewer descriptors are words and not divided further")
      ->capture_default_str();
  command->add_option("--max-iterations", flags->training.max_iterations, "Rounds of clustering")
      ->capture_default_str();
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam vocabulary train footage/ more/*.png --out mine.rotvoc");
  command->callback([flags, &action] { action = [flags] { return Train(*flags); }; });
}

}  // namespace

void AddVocabularyCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<VocabularyFlags>();
  CLI::App* command = app.add_subcommand(
      "vocabulary", "Visual words, by which places are recognised: train, look at, convert");
  command->require_subcommand(1);
  command->footer("Example: rotslam vocabulary train footage/ --out mine.rotvoc");
  AddTrainCommand(*command, flags, action);

  CLI::App* info = command->add_subcommand("info", "What a vocabulary file holds");
  info->add_option("file", flags->in, "Vocabulary file; default: the one in this program");
  AddCommonFlags(*info, flags->common);
  info->footer("Example: rotslam vocabulary info ORBvoc.txt");
  info->callback([flags, &action] { action = [flags] { return PrintInfo(*flags); }; });

  CLI::App* convert = command->add_subcommand("convert", "From text to binary or back");
  convert->add_option("in", flags->in, "Vocabulary file, text or binary")->required();
  AddOutFlags(*convert, *flags);
  AddCommonFlags(*convert, flags->common);
  convert->footer("Example: rotslam vocabulary convert ORBvoc.txt --out ORBvoc.rotvoc");
  convert->callback([flags, &action] { action = [flags] { return Convert(*flags); }; });
}

}  // namespace rotslam
