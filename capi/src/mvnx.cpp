#include <ulna/mvnx.h>

#include <memory>

#include "arguments.hpp"
#include "guard.hpp"
#include "handles.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

template <class T>
const T& numbered(const std::vector<T>& all, int64_t index, const char* argument) {
  require(index >= 0 && index < std::ssize(all), argument,
          std::string(argument) + " is " + std::to_string(index) + ", there are " +
              std::to_string(all.size()));
  return all[static_cast<std::size_t>(index)];
}

void write_numbers(const std::vector<double>& values, double* out, int64_t capacity,
                   int64_t* out_count) {
  write_array(values.data(), std::ssize(values), out, capacity, out_count);
}

std::string kinds_of(const std::vector<MvnxPose>& poses) {
  std::string text;
  for (const MvnxPose& pose : poses) text += (&pose == &poses.front() ? "" : "\n") + pose.kind;
  return text;
}

}  // namespace

ulna_status ulna_mvnx_frames_new(const char* name, const char* const* elements,
                                 int64_t element_count, int64_t first_line,
                                 ulna_mvnx_frames** out_frames) {
  return guarded([&] {
    ulna_mvnx_frames*& out = deref(out_frames, "out_frames");
    out = new ulna_mvnx_frames{MvnxFrames(
        text_of(name, "name"), name_list(elements, element_count, "elements"), first_line)};
  });
}

void ulna_mvnx_frames_free(ulna_mvnx_frames* frames) { delete frames; }

ulna_status ulna_mvnx_frames_push(ulna_mvnx_frames* frames, const char* data, int64_t size,
                                  int64_t* out_used, int32_t* out_done) {
  return guarded([&] {
    MvnxFrames& f = deref(frames, "frames").frames;
    int64_t& used = deref(out_used, "out_used");
    int32_t& done = deref(out_done, "out_done");
    require(size >= 0 && (data != nullptr || size == 0), "data", "data must hold size bytes");
    used = static_cast<int64_t>(f.push(data, static_cast<std::size_t>(size)));
    done = f.done() ? 1 : 0;
  });
}

ulna_status ulna_mvnx_frames_size(const ulna_mvnx_frames* frames, int64_t* out_frames,
                                  int64_t* out_line) {
  return guarded([&] {
    const MvnxFrames& f = deref(frames, "frames").frames;
    int64_t& count = deref(out_frames, "out_frames");
    deref(out_line, "out_line") = f.line();
    count = f.frames();
  });
}

ulna_status ulna_mvnx_frames_clock(const ulna_mvnx_frames* frames, double* out, int64_t capacity,
                                   int64_t* out_count) {
  return guarded([&] {
    const MvnxFrames& f = deref(frames, "frames").frames;
    std::vector<double> clock;
    for (std::size_t i = 0; i < f.index().size(); ++i) {
      clock.insert(clock.end(), {static_cast<double>(f.index()[i]), f.time_ms()[i]});
    }
    write_numbers(clock, out, capacity, out_count);
  });
}

ulna_status ulna_mvnx_frames_numbers(const ulna_mvnx_frames* frames, int64_t element, double* out,
                                     int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const MvnxFrames& f = deref(frames, "frames").frames;
    write_numbers(numbered(f.tables(), element, "element").numbers, out, capacity, out_count);
  });
}

ulna_status ulna_mvnx_frames_poses(const ulna_mvnx_frames* frames, char* out_text, int64_t capacity,
                                   int64_t* out_size) {
  return guarded([&] {
    write_text(kinds_of(deref(frames, "frames").frames.poses()), out_text, capacity, out_size);
  });
}

ulna_status ulna_mvnx_frames_pose(const ulna_mvnx_frames* frames, int64_t pose, int32_t positions,
                                  double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const MvnxPose& p = numbered(deref(frames, "frames").frames.poses(), pose, "pose");
    write_numbers(flag(positions, "positions") ? p.position : p.orientation, out, capacity,
                  out_count);
  });
}
