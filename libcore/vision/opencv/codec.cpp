// libulna_vision: files of pictures and films by OpenCV.
#include "vision/codec.hpp"

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include <exception>

namespace ulna::vision {
namespace {

template <class Body>
std::string without_throwing(const Body& body) noexcept {
  try {
    return body();
  } catch (const cv::Exception& failure) {
    return "OpenCV refused it: " + failure.err;
  } catch (const std::exception& failure) {
    return failure.what();
  } catch (...) {
    return "OpenCV failed";
  }
}

// OpenCV's order is blue, green, red. It takes pixels as if it would change them, and does not.
cv::Mat blue_first(const PictureView& picture) {
  const cv::Mat rgb(picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  return bgr;
}

class OpenCvVideo final : public VideoCodec {
 public:
  explicit OpenCvVideo(cv::VideoWriter writer) : writer_(std::move(writer)) {}

  std::string add(const PictureView& picture) noexcept override {
    return without_throwing([&] {
      writer_.write(blue_first(picture));
      return std::string();
    });
  }

  std::string close() noexcept override {
    return without_throwing([&] {
      writer_.release();
      return std::string();
    });
  }

 private:
  cv::VideoWriter writer_;
};

class OpenCv final : public Codec {
 public:
  // Its own words go to the terminal, where nobody asked for them.
  OpenCv() { cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT); }

  std::string write_png(const char* path, const PictureView& picture) noexcept override {
    return without_throwing([&] {
      const bool written = cv::imwrite(path, blue_first(picture));
      return std::string(written ? "" : "the picture could not be written");
    });
  }

  std::string read_png(const char* path, Picture& picture) noexcept override {
    return without_throwing([&] {
      const cv::Mat bgr = cv::imread(path, cv::IMREAD_COLOR);
      if (bgr.empty()) return std::string("this is no picture");
      picture.width = bgr.cols;
      picture.height = bgr.rows;
      picture.rgb.resize(3 * bgr.total());
      cv::Mat rgb(bgr.rows, bgr.cols, CV_8UC3, picture.rgb.data());
      cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
      return std::string();
    });
  }

  std::string open_video(const char* path, int width, int height, double rate_hz,
                         std::unique_ptr<VideoCodec>& video) noexcept override {
    return without_throwing([&] {
      for (const int code : {cv::VideoWriter::fourcc('a', 'v', 'c', '1'),
                             cv::VideoWriter::fourcc('m', 'p', '4', 'v')}) {
        cv::VideoWriter writer;
        if (writer.open(path, cv::CAP_FFMPEG, code, rate_hz, cv::Size(width, height))) {
          video = std::make_unique<OpenCvVideo>(std::move(writer));
          return std::string();
        }
      }
      return std::string("the film could not be opened for writing");
    });
  }

  std::string read_video(const char* path, VideoFacts& facts) noexcept override {
    return without_throwing([&] {
      cv::VideoCapture film(path, cv::CAP_FFMPEG);
      if (!film.isOpened()) return std::string("this is no film");
      facts.width = static_cast<int>(film.get(cv::CAP_PROP_FRAME_WIDTH));
      facts.height = static_cast<int>(film.get(cv::CAP_PROP_FRAME_HEIGHT));
      facts.rate_hz = film.get(cv::CAP_PROP_FPS);
      // Counted, because the number in the file's head is an estimate for some films.
      for (cv::Mat frame; film.read(frame);) ++facts.frames;
      return std::string();
    });
  }
};

}  // namespace
}  // namespace ulna::vision

extern "C" __attribute__((visibility("default"))) ulna::vision::Codec* ulna_vision_codec() {
  static ulna::vision::OpenCv codec;
  return &codec;
}
