#pragma once

#include <filesystem>
#include <vector>

#include "rotodom/sequence/frames.h"
#include "rotodom/sequence/layout.h"

namespace rotslam {

/// Adds images to a layout, with the times of the first of these that fits them:
///   a list in one of `places`: `times.txt`, `timestamps.txt`, `timestamp.txt`, `image_timestamps`,
///     or a `*.csv` that names images. A line is `time`, `time name`, `name time` or
///     `id time exposure`. Without names or ids the list needs as many lines as there are images,
///     or more where the images are numbered: then a number is that of a line, from 0;
///   the names of the images, as TimesOfNames says;
///   options.fps, which is noted.
/// Images that a list with names leaves out are left out, which is noted; so is a list that does
/// not fit.
/// @param files  in the order of their names.
/// Throws std::runtime_error naming file and line where a list holds something else than a time, or
/// the folder where `files` is empty.
void AddImages(std::vector<std::filesystem::path> files,
               const std::vector<std::filesystem::path>& places,
               const SequenceOptions& options,
               Layout& layout);

/// Adds images of a data set whose list `times` has one line for each frame. Images that are called
/// by their number have the time of that line, from 0; else they must be as many as the times.
/// Throws std::runtime_error naming file and line where that is no time, or an image has none.
void AddNumberedImages(std::vector<std::filesystem::path> files,
                       const std::filesystem::path& times,
                       Layout& layout);

/// Adds the images that a list names, one a line: `time name`, or `time name time name` of images
/// and depth maps in any order, of which those that names tell are taken. Times that are the
/// numbers of the images are none: options.fps makes them.
/// @param folders  as ListedFiles takes them.
/// Throws std::runtime_error naming file and line where a line is another one.
void AddListedImages(const std::filesystem::path& list,
                     const std::vector<std::filesystem::path>& folders,
                     const SequenceOptions& options,
                     Layout& layout);

}  // namespace rotslam
