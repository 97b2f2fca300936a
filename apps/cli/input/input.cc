#include "apps/cli/input/input.h"

#include "rotodom/camera/camera_form.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam {

void InputFlags::Override(SequenceOptions& options) const {
  if (first) options.first = *first;
  if (last) options.last = *last;
  if (stride) options.stride = *stride;
  if (fps) options.fps = *fps;
}

void InputFlags::Override(LoopOptions& options) const {
  if (loops) options.use_loops = *loops;
}

void AddInputFlags(CLI::App& command, InputFlags& flags) {
  command
      .add_option("sequence",
                  flags.sequence,
                  "Folder of images, video or recording; known are " + SequenceFormNames())
      ->required();
  command.add_option("--camera",
                     flags.camera,
                     "Calibration, of several cameras FILE:NAME: " + CameraFormNames() +
                         ". Without one, what lies with the images is taken, else the lens is "
                         "estimated from the images; `none`: estimated in any case");
  command.add_flag("--focal-guess", flags.focal_guess, "The same as --camera none")
      ->excludes("--camera");
  command.add_option("--out", flags.out, "Folder for the results, made if it is not there")
      ->required();
  command.add_option("--first", flags.first, "First input frame to use");
  command.add_option("--last", flags.last, "Last input frame to use; -1: to the end");
  command.add_option("--stride", flags.stride, "Use every n-th frame");
  command.add_flag_function(
      "--loops,!--no-loops",
      [&flags](std::int64_t given) { flags.loops = given > 0; },
      "Look for places seen before and spread the drift (the default)");
  command.add_option("--vocabulary",
                     flags.vocabulary,
                     "Visual words for that: our own file or ORB-SLAM's ORBvoc.txt; not needed");
  command.add_option("--mask",
                     flags.mask,
                     "Image of the frames' size, black where all frames are to be ignored (a "
                     "display, a bonnet)");
  command.add_option("--masks",
                     flags.masks,
                     "Folder of such images, one per frame, by name: 0001.jpg.png, as COLMAP has "
                     "it, or 0001.png (people, the sky)");
  command.add_flag("--auto-mask,!--no-auto-mask",
                   flags.auto_mask,
                   "Find and ignore what never moves on the picture: text, drops, dirt, a border "
                   "(the default)");
  command.add_option("--fps", flags.fps, "Frames per second where the input has no timestamps");
}

}  // namespace rotslam
