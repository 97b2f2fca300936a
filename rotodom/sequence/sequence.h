#pragma once

#include <filesystem>
#include <memory>

#include "rotodom/sequence/frames.h"

namespace rotslam {

/// Opens what lies at `path`, recognised by one of SequenceForms (sequence_form.h), where each is
/// described.
///
/// Timestamps come from the data set's list, from a list that lies with the images, or from their
/// names (image_times.h, times.h); else options.fps makes them up, which is noted. Images are
/// ordered by time or, digits counting as numbers, by name. A video has its own timestamps;
/// those of a bare stream of frames are made up, which is noted.
///
/// Images are taken as stored, whatever orientation their EXIF data ask for (a phone changes its
/// mind in mid-sequence when it looks up or down); videos are turned upright as players do, by
/// their display matrix.
/// Pixels of 10 to 16 bits and floating-point ones are scaled to 8 bits, the same for the whole
/// sequence (image_file.h), which is noted; transparency is dropped.
///
/// Throws std::invalid_argument when options.Problem(); std::runtime_error, with path and reason in
/// one line, when nothing is there, nothing can be read, a list is malformed, or timestamps do not
/// increase.
std::unique_ptr<Sequence> OpenSequence(const std::filesystem::path& path,
                                       const SequenceOptions& options);

}  // namespace rotslam
