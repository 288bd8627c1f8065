// Pictures and films as files: what was written is read again, and what cannot be says why.
#include "vision/picture.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "base/error.hpp"
#include "refusal.hpp"

namespace ulna::vision {
namespace {

using made::expect_refusal;

class Files : public testing::Test {
 protected:
  Files() {
    use_codec_library(ULNA_VISION_LIBRARY);
    // Tests run at the same time.
    const std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
    folder_ = std::filesystem::temp_directory_path() / ("ulna_vision_" + name);
    std::filesystem::create_directories(folder_);
  }
  ~Files() override {
    std::error_code error;
    std::filesystem::remove_all(folder_, error);
  }
  std::string path(const char* name) const { return (folder_ / name).string(); }

  std::filesystem::path folder_;
};

Picture pattern(int width, int height, int shift) {
  Picture picture{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        picture.rgb.push_back(static_cast<std::uint8_t>((x * (c + 1) + 3 * y + shift) % 256));
      }
    }
  }
  return picture;
}

PictureView view(const Picture& p) { return {p.rgb.data(), p.width, p.height}; }

TEST_F(Files, PngHoldsEveryBitInTheOrderOfItsColours) {
  for (const int width : {1, 7, 320}) {
    const Picture picture = pattern(width, 33, 5);
    write_png(path("a.png"), view(picture));
    const Picture read = read_png(path("a.png"));
    EXPECT_EQ(read.width, width);
    EXPECT_EQ(read.height, 33);
    EXPECT_EQ(read.rgb, picture.rgb);
  }
}

TEST_F(Files, FilmHasItsPicturesAndItsRate) {
  VideoWriter film(path("a.mp4"), 160, 120, 25.0);
  for (int i = 0; i < 17; ++i) film.add(view(pattern(160, 120, 9 * i)));
  EXPECT_EQ(film.frames(), 17);
  film.close();
  film.close();
  const VideoFacts facts = video_facts(path("a.mp4"));
  EXPECT_EQ(facts.frames, 17);
  EXPECT_EQ(facts.width, 160);
  EXPECT_EQ(facts.height, 120);
  EXPECT_NEAR(facts.rate_hz, 25.0, 1e-6);
  expect_refusal([&] { film.add(view(pattern(160, 120, 0))); }, "closed");
}

TEST_F(Files, FilmThatIsLeftIsEnded) {
  {
    VideoWriter film(path("a.mp4"), 64, 48, 10.0);
    for (int i = 0; i < 3; ++i) film.add(view(pattern(64, 48, i)));
  }
  EXPECT_EQ(video_facts(path("a.mp4")).frames, 3);
}

TEST_F(Files, WhatCannotBeSaysWhy) {
  const Picture picture = pattern(16, 16, 0);
  expect_refusal([&] { write_png(path("a.jpg"), view(picture)); }, "must end with .png");
  expect_refusal(
      [&] {
        write_png(path("a.png"), {picture.rgb.data(), 0, 16});
      },
      "between 1 and 16384");
  expect_refusal([&] { write_png(path("a.png"), {nullptr, 2, 2}); }, "no pixels");
  expect_refusal([&] { write_png(path("no/a.png"), view(picture)); }, "no folder", Fault::kFile);
  expect_refusal([&] { read_png(path("b.png")); }, "no file", Fault::kFile);
  std::ofstream(path("c.png")) << "this is text";
  expect_refusal([&] { read_png(path("c.png")); }, "no picture", Fault::kFile);
  std::ofstream(path("c.mp4")) << "this is text";
  expect_refusal([&] { video_facts(path("c.mp4")); }, "no film", Fault::kFile);
  std::filesystem::create_directory(path("d.png"));
  expect_refusal([&] { write_png(path("d.png"), view(picture)); }, "could not be written",
                 Fault::kFile);

  expect_refusal([&] { VideoWriter film(path("a.avi"), 16, 16, 25); }, ".mp4");
  expect_refusal([&] { VideoWriter film(path("a.mp4"), 17, 16, 25); }, "even");
  expect_refusal([&] { VideoWriter film(path("a.mp4"), 16, 16, 0.0); }, "pictures a second");
  expect_refusal([&] { VideoWriter film(path("no/a.mp4"), 16, 16, 25); }, "no folder",
                 Fault::kFile);
  std::filesystem::create_directory(path("d.mp4"));
  expect_refusal([&] { VideoWriter film(path("d.mp4"), 16, 16, 25); }, "could not be opened",
                 Fault::kFile);
  VideoWriter film(path("a.mp4"), 32, 32, 25);
  expect_refusal([&] { film.add(view(picture)); }, "32 x 32");
}

TEST_F(Files, WithoutTheirLibraryTheyNameThePackages) {
  use_codec_library(path("libulna_vision.so"));
  const Picture picture = pattern(16, 16, 0);
  expect_refusal([&] { write_png(path("a.png"), view(picture)); }, "libopencv-imgcodecs406",
                 Fault::kUnsupported);
  EXPECT_FALSE(std::filesystem::exists(path("a.png")));
  use_codec_library(ULNA_VISION_LIBRARY);
  write_png(path("a.png"), view(picture));
}

}  // namespace
}  // namespace ulna::vision
