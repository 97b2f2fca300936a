// What the commands read besides: options, lists of sequences, records of a batch, EXIF data.

#include "apps/batch/list.h"
#include "apps/batch/record.h"
#include "apps/config.h"
#include "apps/focal_guess.h"
#include "apps/pipeline.h"
#include "apps/simulation/paths.h"
#include "tests/fuzz/fuzz_target.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

const RegisterFuzzTarget config("config",
                                [](std::string_view bytes, const TemporaryFolder& folder) {
                                  PipelineOptions options;
                                  LoadOptionsYaml(folder.Write("options.yaml", std::string(bytes)),
                                                  options);
                                });

const RegisterFuzzTarget batch_list("batch_list",
                                    [](std::string_view bytes, const TemporaryFolder& folder) {
                                      for (const BatchEntry& entry : ReadBatchList(
                                               folder.Write("batch.yaml", std::string(bytes)),
                                               "")) {
                                        RequestOf(entry, 1);
                                      }
                                    });

const RegisterFuzzTarget batch_record("batch_record",
                                      [](std::string_view bytes, const TemporaryFolder& folder) {
                                        const std::vector<std::string> files =
                                            CutIntoFiles(bytes, 3);
                                        folder.Write("batch.json", files[0]);
                                        folder.Write("summary.json", files[1]);
                                        LastErrorLine(folder.Write("log.txt", files[2]));
                                        const std::optional<BatchRecord> record =
                                            ReadRecord(folder.path());
                                        if (!record) return;
                                        ResultOf({}, folder.path(), record->request, 1);
                                      });

const RegisterFuzzTarget exif("exif", [](std::string_view bytes, const TemporaryFolder& folder) {
  FilmFocalLength(folder.Write("image.jpg", std::string(bytes)));
});

const RegisterFuzzTarget kitti_poses("kitti_poses",
                                     [](std::string_view bytes, const TemporaryFolder& folder) {
                                       ReadKittiPoses(
                                           folder.Write("poses.txt", std::string(bytes)));
                                     });

}  // namespace
}  // namespace rotslam
