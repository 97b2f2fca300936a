#include "apps/cli/input/lens_guess.h"

#include <cmath>
#include <filesystem>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "tests/rotodom/sequence/scratch_folder.h"
#include "tests/rotodom/sequence/test_video.h"

namespace rotslam {
namespace {

using Tags = std::map<std::string, std::string>;

class LensGuessTest : public ScratchFolderTest {
 protected:
  FocalGuess GuessOf(const std::string& name, const Tags& tags) const {
    const std::filesystem::path file = folder_ / name;
    TestStream stream;
    stream.pictures = GreyPictures(4);
    WriteTestVideo(file, {stream}, tags);
    return GuessFocal(file, {}, *OpenSequence(file, {}));
  }
};

TEST(FilmFocalLength, ReadsTheTagsOfAllMakers) {
  EXPECT_EQ(
      FilmFocalLength(Tags{{"com.apple.quicktime.camera.focal_length.35mm_equivalent", "26"}}),
      26.0);
  EXPECT_EQ(FilmFocalLength(Tags{{"FocalLengthIn35mmFormat", "24.5 mm"}}), 24.5);
  EXPECT_EQ(FilmFocalLength(Tags{{"FOCAL_LEN_IN_35MM_FILM", "53/2"}}), 26.5);
}

TEST(FilmFocalLength, BelievesNoNonsense) {
  EXPECT_FALSE(FilmFocalLength(Tags()));
  // The lens' own, which says nothing without the sensor's size.
  EXPECT_FALSE(FilmFocalLength(Tags{{"com.apple.quicktime.camera.focal_length", "5.7"}}));
  for (const char* value : {"", "0", "-26", "unknown", "26/0", "0/0", "nan", "inf", "1e9"}) {
    EXPECT_FALSE(FilmFocalLength(Tags{{"focal_length.35mm_equivalent", value}})) << value;
  }
}

TEST_F(LensGuessTest, StartsFromTheTagsOfAVideo) {
  for (const char* name : {"phone.mov", "phone.mp4"}) {
    const FocalGuess guess =
        GuessOf(name, {{"com.apple.quicktime.camera.focal_length.35mm_equivalent", "26"}});
    EXPECT_EQ(guess.source, FocalSource::kVideoMetadata) << name;
    EXPECT_TRUE(guess.KnowsFocal());
    // 64 x 48 pixels have a diagonal of 80.
    EXPECT_NEAR(guess.focal_px, 26.0 / std::hypot(36.0, 24.0) * 80.0, 1e-9) << name;
  }
}

TEST_F(LensGuessTest, StartsFromTheImageSizeWithoutThem) {
  const FocalGuess guess = GuessOf("film.mov", {{"com.apple.quicktime.model", "a phone"}});
  EXPECT_EQ(guess.source, FocalSource::kImageSize);
  EXPECT_FALSE(guess.KnowsFocal());
  EXPECT_EQ(guess.focal_px, 1.2 * 64.0);
}

}  // namespace
}  // namespace rotslam
