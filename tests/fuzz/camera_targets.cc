#include <stdexcept>

#include "rotodom/camera/read_camera.h"
#include "tests/fuzz/fuzz_target.h"

namespace rotslam {
namespace {

const RegisterFuzzTarget camera("camera",
                                [](std::string_view bytes, const TemporaryFolder& folder) {
                                  const CameraFile file =
                                      ReadCameraFile(folder.Write("camera", std::string(bytes)));
                                  for (const NamedCamera& named : file.cameras) {
                                    // One of several cameras that cannot be read is refused as a
                                    // whole file is.
                                    if (!named.problem.empty())
                                      throw std::runtime_error(named.problem);
                                    const Camera read = AtSize(named, 640, 480);
                                    // What was taken for good must be of use.
                                    for (const double x : {0.0, 10.0, 1e4}) {
                                      if (const auto bearing = read.Unproject({x, 0.5 * x}))
                                        read.Project(*bearing);
                                    }
                                  }
                                });

}  // namespace
}  // namespace rotslam
