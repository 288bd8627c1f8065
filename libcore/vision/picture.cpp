#include "vision/picture.hpp"

#include <dlfcn.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <mutex>

#include "base/error.hpp"
#include "vision/codec.hpp"

namespace ulna::vision {
namespace {

constexpr int kLongest = 16384;  // pixels of a side

struct CodecPlace {
  std::mutex mutex;
  std::string path;
  Codec* codec = nullptr;
};

CodecPlace& codec_place() {
  static CodecPlace place;
  return place;
}

// The folder of the library or program that this function is in.
std::string own_folder() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<void*>(&codec_place), &info) == 0 || info.dli_fname == nullptr) {
    return "";
  }
  return std::filesystem::path(info.dli_fname).parent_path().string();
}

// Never unloaded: drivers and encoders that OpenCV loads do not survive it.
void* load_codec(const std::string& given) {
  if (!given.empty()) return dlopen(given.c_str(), RTLD_NOW);
  const std::string folder = own_folder();
  if (!folder.empty()) {
    if (void* found = dlopen((folder + "/" + kCodecLibrary).c_str(), RTLD_NOW)) return found;
    // There but not loadable: the loader's words say which library it lacks.
    if (std::filesystem::exists(folder + "/" + kCodecLibrary)) return nullptr;
  }
  return dlopen(kCodecLibrary, RTLD_NOW);
}

Codec& codec() {
  CodecPlace& place = codec_place();
  const std::lock_guard lock(place.mutex);
  if (place.codec != nullptr) return *place.codec;
  void* library = load_codec(place.path);
  void* symbol = library == nullptr ? nullptr : dlsym(library, kCodecSymbol);
  if (symbol == nullptr) {
    const char* why = dlerror();
    throw Error(Fault::kUnsupported, "",
                std::string("pictures and films are written by ") + kCodecLibrary +
                    " with OpenCV, which cannot be loaded: install the Debian packages "
                    "libopencv-imgcodecs406 and libopencv-videoio406 (" +
                    (why == nullptr ? "no reason given" : why) + ")");
  }
  CodecFunction make = nullptr;
  std::memcpy(&make, &symbol, sizeof symbol);
  place.codec = make();
  return *place.codec;
}

void check_ending(const std::string& path, const char* ending) {
  std::string written = std::filesystem::path(path).extension().string();
  for (char& c : written) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  require(written == ending, "path", "the path " + path + " must end with " + ending);
}

// OpenCV does not tell why a file could not be made.
void check_folder(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty() || std::filesystem::is_directory(folder)) return;
  throw Error(Fault::kFile, "path", "there is no folder " + folder.string());
}

void check_file(const std::string& path) {
  if (std::filesystem::is_regular_file(path)) return;
  throw Error(Fault::kFile, "path", "there is no file " + path);
}

void check_size(int width, int height) {
  require(width >= 1 && height >= 1 && width <= kLongest && height <= kLongest, "size",
          "a picture must have between 1 and 16384 pixels along each side");
}

void succeed(const std::string& failure, const std::string& path) {
  if (!failure.empty()) throw Error(Fault::kFile, "path", path + ": " + failure);
}

}  // namespace

void use_codec_library(const std::string& path) {
  CodecPlace& place = codec_place();
  const std::lock_guard lock(place.mutex);
  place.path = path;
  place.codec = nullptr;
}

void write_png(const std::string& path, const PictureView& picture) {
  check_ending(path, ".png");
  check_size(picture.width, picture.height);
  require(picture.rgb != nullptr, "picture", "the picture has no pixels");
  check_folder(path);
  succeed(codec().write_png(path.c_str(), picture), path);
}

Picture read_png(const std::string& path) {
  check_ending(path, ".png");
  check_file(path);
  Picture picture;
  succeed(codec().read_png(path.c_str(), picture), path);
  return picture;
}

VideoFacts video_facts(const std::string& path) {
  check_file(path);
  VideoFacts facts;
  succeed(codec().read_video(path.c_str(), facts), path);
  return facts;
}

VideoWriter::VideoWriter(const std::string& path, int width, int height, double rate_hz)
    : path_(path), width_(width), height_(height) {
  check_ending(path, ".mp4");
  check_size(width, height);
  require(width % 2 == 0 && height % 2 == 0, "size",
          "width and height of a film must be even numbers of pixels");
  require(std::isfinite(rate_hz) && rate_hz >= 1.0 && rate_hz <= 1000.0, "rate_hz",
          "a film must have between 1 and 1000 pictures a second");
  check_folder(path);
  succeed(codec().open_video(path.c_str(), width, height, rate_hz, codec_), path);
}

VideoWriter::~VideoWriter() {
  if (codec_ != nullptr) codec_->close();
}
VideoWriter::VideoWriter(VideoWriter&&) noexcept = default;
VideoWriter& VideoWriter::operator=(VideoWriter&&) noexcept = default;

void VideoWriter::add(const PictureView& picture) {
  require(codec_ != nullptr, "video", "the film is closed");
  require(picture.rgb != nullptr && picture.width == width_ && picture.height == height_, "picture",
          "the film has pictures of " + std::to_string(width_) + " x " + std::to_string(height_) +
              " pixels, this one has " + std::to_string(picture.width) + " x " +
              std::to_string(picture.height));
  succeed(codec_->add(picture), path_);
  ++frames_;
}

void VideoWriter::close() {
  if (codec_ == nullptr) return;
  const std::string failure = codec_->close();
  codec_.reset();
  succeed(failure, path_);
  if (frames_ == 0) return;
  std::error_code error;
  if (std::filesystem::file_size(path_, error) > 0 && !error) return;
  throw Error(Fault::kFile, "path", path_ + ": the film was not written");
}

}  // namespace ulna::vision
