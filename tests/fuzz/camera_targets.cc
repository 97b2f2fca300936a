#include "rotodom/camera/read_camera.h"
#include "tests/fuzz/fuzz_target.h"

namespace rotslam {
namespace {

const RegisterFuzzTarget camera("camera",
                                [](std::string_view bytes, const TemporaryFolder& folder) {
                                  const Camera read =
                                      ReadCamera(folder.Write("camera", std::string(bytes)));
                                  // What was taken for good must be of use.
                                  for (const double x : {0.0, 10.0, 1e4}) {
                                    if (const auto bearing = read.Unproject({x, 0.5 * x}))
                                      read.Project(*bearing);
                                  }
                                });

}  // namespace
}  // namespace rotslam
