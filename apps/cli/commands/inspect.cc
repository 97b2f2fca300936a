#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <sys/ioctl.h>
#include <unistd.h>

#include "apps/cli/command.h"
#include "apps/cli/input/input.h"
#include "apps/cli/input/input_lines.h"
#include "apps/cli/input/open_input.h"
#include "apps/cli/terminal/progress.h"
#include "apps/cli/terminal/thumbnail.h"
#include "output/graph/rotation_graph_form.h"
#include "output/graph/rotation_list_file.h"
#include "output/trajectory/trajectory.h"
#include "output/trajectory/trajectory_form.h"
#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/sequence/sequence_form.h"
#include "rotodom/types/disjoint_sets.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

struct InspectFlags {
  CommonFlags common;
  std::string input;
  std::string camera;
  std::string frame;  // file for the first frame; empty: none
  std::string times;  // of trajectories without times
  std::optional<double> fps;
  bool forms = false;
};

void PrintLine(const std::string& line) { std::printf("%s\n", line.c_str()); }

void PrintNotes(const std::vector<std::string>& notes) {
  for (const std::string& note : notes) PrintLine("note:   " + note);
}

// The columns of the terminal that shows standard output; 0 where it goes elsewhere.
int TerminalColumns() {
  winsize size{};
  if (isatty(STDOUT_FILENO) == 0) return 0;
  return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 80;
}

void ShowFrame(const InspectFlags& flags, const cv::Mat& image) {
  constexpr int kMostColumns = 72;
  if (!flags.frame.empty()) {
    if (!cv::imwrite(flags.frame, image)) {
      throw std::runtime_error(flags.frame + ": cannot be written; its name must end in .png");
    }
    PrintLine("frame:  " + flags.frame);
  }
  const int columns = TerminalColumns();
  if (columns == 0) return;
  const bool in_colour = std::getenv("NO_COLOR") == nullptr;  // NOLINT(concurrency-mt-unsafe)
  std::fputs(TerminalPicture(image, std::min(columns, kMostColumns), in_colour).c_str(), stdout);
}

int InspectSequence(const InspectFlags& flags) {
  InputFlags input_flags;
  input_flags.sequence = flags.input;
  input_flags.camera = flags.camera;
  SequenceOptions options;
  if (flags.fps) options.fps = *flags.fps;
  Input input;
  input.frames = std::make_unique<SequenceSource>(flags.input, options);
  const std::optional<Frame> first = input.frames->Next();
  input.frames->Skip(std::numeric_limits<int>::max());
  for (const std::string& line : DescribeSequence(input.sequence())) PrintLine(line);
  int exit_code = 0;
  try {
    if (ReadCalibration(input_flags, input)) {
      for (const std::string& line : DescribeCamera(input)) PrintLine(line);
    } else {
      PrintLine(
          "camera: no calibration lies with the images; `rotslam run` then estimates the lens from "
          "them");
    }
  } catch (const std::runtime_error& error) {
    PrintLine(std::string("camera: ") + error.what());
    exit_code = 1;
  }
  if (const auto& truth = input.sequence().GroundTruthFile())
    PrintLine("truth:  " + truth->string());
  if (first && first->image.empty()) {
    PrintLine("frame:  " + first->name + " cannot be read: " + first->problem);
    return 1;
  }
  if (first) ShowFrame(flags, first->image);
  return exit_code;
}

int InspectCamera(const CameraReference& reference) {
  const CameraFile file = ReadCameraFile(reference.file);
  PrintLine("input:  camera file, " + file.form + ", " + reference.file.string());
  for (const NamedCamera& camera : file.cameras) {
    if (!reference.name.empty() && camera.name != reference.name) continue;
    PrintLine("camera: " + (camera.name.empty() ? "" : camera.name + ": ") +
              Describe(camera.camera));
  }
  PrintNotes(file.notes);
  return 0;
}

int InspectGraph(const fs::path& path) {
  const RotationList list = ReadRotationList(path, kRadFromDeg);
  PrintLine("input:  graph of relative rotations, " + list.form + ", " + path.string());
  DisjointSets sets(static_cast<int>(list.ids.size()));
  for (const RelativeRotation& edge : list.edges) sets.Join(edge.i.value, edge.j.value);
  int num_components = 0;
  for (int k = 0; k < std::ssize(list.ids); ++k) num_components += sets.Find(k) == k ? 1 : 0;
  PrintLine("graph:  " + std::to_string(list.ids.size()) + " views, " +
            std::to_string(list.edges.size()) + " edges, " + std::to_string(num_components) +
            (num_components == 1 ? " component" : " components"));
  PrintNotes(list.notes);
  if (!list.unread.empty()) PrintNotes({"not read: " + list.unread});
  return 0;
}

int InspectTrajectory(const InspectFlags& flags) {
  std::optional<fs::path> times;
  if (!flags.times.empty()) times = flags.times;
  const TrajectoryFile file = ReadTrajectoryFile(flags.input, times);
  PrintLine("input:  trajectory, " + file.form + ", " + flags.input);
  std::vector<double> times_s;
  double length = 0.0;
  double turn_rad = 0.0;
  for (std::size_t k = 0; k < file.poses.size(); ++k) {
    times_s.push_back(file.poses[k].timestamp_s);
    if (k == 0) continue;
    length += (file.poses[k].center_in_world - file.poses[k - 1].center_in_world).norm();
    turn_rad += (file.poses[k].world_from_cam.Inverse() * file.poses[k - 1].world_from_cam).Angle();
  }
  char text[160];
  std::snprintf(text,
                sizeof(text),
                "poses:  %zu, path of %.4g units, turns of %.4g deg in all",
                file.poses.size(),
                length,
                kDegFromRad * turn_rad);
  PrintLine(text);
  PrintLine("times:  " + DescribeTimes(times_s, true));
  PrintNotes(file.notes);
  return 0;
}

// One table of forms as Markdown has it.
template <class Form>
void PrintForms(const char* title, const std::vector<Form>& forms) {
  std::printf("### %s\n\n| form | how it is told |\n|---|---|\n", title);
  for (const Form& form : forms) {
    std::printf("| %s | %s |\n", form.name.c_str(), form.description.c_str());
  }
  std::printf("\n");
}

int Inspect(const InspectFlags& flags) {
  if (flags.forms) {
    PrintForms("Sequences", SequenceForms());
    PrintForms("Camera files", CameraForms());
    PrintForms("Trajectories", TrajectoryForms());
    PrintForms("Graphs of relative rotations", RotationGraphForms());
    return 0;
  }
  if (flags.input.empty()) throw std::invalid_argument("inspect: give an input, or --forms");
  const CameraReference reference = ParseCameraReference(flags.input);
  // Text is asked first: a folder may hold poses, a video is anything that no other form takes.
  std::error_code ignored;
  const bool is_file = fs::is_regular_file(reference.file, ignored);
  if (is_file && RecogniseCameraFile(reference.file)) return InspectCamera(reference);
  if (IsSequence(flags.input)) return InspectSequence(flags);
  if (RecogniseTrajectory(flags.input)) return InspectTrajectory(flags);
  if (is_file && RecogniseRotationList(flags.input)) return InspectGraph(flags.input);
  // No form takes it: the reader of the likeliest one says why.
  if (is_file) return InspectCamera(reference);
  return InspectSequence(flags);
}

}  // namespace

void AddInspectCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<InspectFlags>();
  CLI::App* command = app.add_subcommand(
      "inspect", "What an input is taken for: a sequence, camera file, trajectory or graph");
  command->add_option("input", flags->input, "Sequence, camera file, trajectory or graph");
  command->add_option("--camera", flags->camera, "Calibration of a sequence, FILE or FILE:NAME");
  command->add_option("--frame", flags->frame, "PNG file for the first frame, as it is read");
  command->add_option("--fps", flags->fps, "Frames per second where a sequence has no times")
      ->check(AboveZero());
  command->add_option("--times", flags->times, "Timestamps of a trajectory without times");
  command->add_flag("--forms", flags->forms, "List all forms that are read, as Markdown tables");
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam inspect footage.mp4 --camera phone.yaml --frame first.png");
  command->callback([flags, &action] { action = [flags] { return Inspect(*flags); }; });
}

}  // namespace rotslam
