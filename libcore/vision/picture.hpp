// Pictures and films as files: PNG and MP4. Pixels are red, green, blue, 8 bits each, row by row
// from the top.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/types.hpp"

namespace ulna::vision {

struct PictureView {
  const std::uint8_t* rgb = nullptr;
  int width = 0;  // pixels
  int height = 0;
};

struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;
};

struct VideoFacts {
  int width = 0;
  int height = 0;
  Index frames = 0;
  double rate_hz = 0.0;
};

// Throw Error: kArgument for paths and sizes that cannot be, kFile, kUnsupported when what writes
// pictures is not installed.
void write_png(const std::string& path, const PictureView& picture);
Picture read_png(const std::string& path);
VideoFacts video_facts(const std::string& path);

class VideoCodec;

// A film in H.264, or MPEG-4 part 2 where there is no such encoder. Of one thread at a time.
class VideoWriter {
 public:
  // Width and height must be even. Throws as above.
  VideoWriter(const std::string& path, int width, int height, double rate_hz);
  ~VideoWriter();  // closes
  VideoWriter(VideoWriter&&) noexcept;
  VideoWriter& operator=(VideoWriter&&) noexcept;

  // Throws Error: kArgument for a picture of another size and after close(), kFile.
  void add(const PictureView& picture);
  void close();  // again does nothing; throws Error (kFile) when the file is not what was written
  Index frames() const { return frames_; }

 private:
  std::string path_;
  int width_, height_;
  Index frames_ = 0;
  std::unique_ptr<VideoCodec> codec_;
};

// Where the library that does this is looked for, before the first of these calls. Otherwise beside
// the library or program that this is part of, then where the dynamic loader looks.
void use_codec_library(const std::string& path);

}  // namespace ulna::vision
