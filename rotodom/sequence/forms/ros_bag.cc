#include "rotodom/sequence/bag/bag_reader.h"
#include "rotodom/sequence/bag/bag_sequence.h"
#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam::forms {

SequenceForm SequenceFormRosBag() {
  SequenceForm form;
  form.name = "ROS bag";
  form.description =
      "a recording: `.bag` (ROS 1), `.db3` or `.mcap` (ROS 2), a folder of its files; of several "
      "topics with images one behind a colon: walk.bag:/cam0/image_raw";
  form.rank = 10;  // a data set may have its recording beside the images
  form.recognises = [](const std::filesystem::path& path) {
    return IsBagName(ParseInputReference(path).file);
  };
  form.list = [](const std::filesystem::path& path, const SequenceOptions&) {
    const std::filesystem::path file = ParseInputReference(path).file;
    Layout layout;
    layout.is_video = true;
    layout.folder = path;
    layout.camera = FirstCamera({file / "camera.yaml",
                                 std::filesystem::path(file).replace_extension(".yaml"),
                                 file.parent_path() / "camera.yaml"});
    return layout;
  };
  form.open = OpenBagSequence;
  return form;
}

}  // namespace rotslam::forms
