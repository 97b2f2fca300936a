#include <algorithm>
#include <string>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/kalibr_camera.h"

namespace rotslam {
namespace {

// "cam0", "cam1", "cam12".
bool IsChainKey(const std::string& key) {
  return key.size() > 3 && key.starts_with("cam") &&
         std::all_of(key.begin() + 3, key.end(), [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace

namespace forms {

CameraForm CameraFormKalibr() {
  CameraForm form;
  form.name = "Kalibr chain";
  form.description =
      "Kalibr and OpenVINS: `cam0:` with `camera_model: pinhole`, `intrinsics`, "
      "`distortion_model`, "
      "`distortion_coeffs`; more cameras as `cam1:`, ...";
  form.file_names = {"camchain.yaml", "kalibr_imucam_chain.yaml"};
  form.recognises = [](const CameraDocument& document) {
    const Section root = document.root();
    for (const TreeNode& child : root.node().children) {
      if (IsChainKey(child.key) && child.kind == TreeNode::Kind::kMap) return true;
    }
    return root.HasAny({"relative_config_imucam"});
  };
  form.read = [](const CameraDocument& document) {
    const Section root = document.root();
    CameraFile file;
    for (const TreeNode& child : root.node().children) {
      if (!IsChainKey(child.key) || child.kind != TreeNode::Kind::kMap) continue;
      file.Add(child.key, [&] { return ReadKalibrCamera(root.Map(child.key)); });
    }
    if (file.cameras.empty()) {
      root.FailValue("relative_config_imucam", "the file with the cameras; give that one");
    }
    return file;
  };
  return form;
}

}  // namespace forms
}  // namespace rotslam
