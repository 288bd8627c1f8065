// The part that reads and writes files of pictures and films, a library of its own, libulna_vision:
// OpenCV needs more than two hundred other libraries, which nobody should wait for or install who
// draws no pictures. It is loaded when the first picture or film is written.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "vision/picture.hpp"

namespace ulna::vision {

// No exception crosses the border between the libraries: functions return why they failed, or "".
class VideoCodec {
 public:
  virtual ~VideoCodec() = default;
  virtual std::string add(const PictureView& picture) noexcept = 0;
  virtual std::string close() noexcept = 0;
};

class Codec {
 public:
  virtual ~Codec() = default;
  virtual std::string write_png(const char* path, const PictureView& picture) noexcept = 0;
  virtual std::string read_png(const char* path, Picture& picture) noexcept = 0;
  virtual std::string open_video(const char* path, int width, int height, double rate_hz,
                                 std::unique_ptr<VideoCodec>& video) noexcept = 0;
  virtual std::string read_video(const char* path, VideoFacts& facts) noexcept = 0;
};

constexpr const char* kCodecLibrary = "libulna_vision.so.0";
constexpr const char* kCodecSymbol = "ulna_vision_codec";
using CodecFunction = Codec* (*)();

}  // namespace ulna::vision
