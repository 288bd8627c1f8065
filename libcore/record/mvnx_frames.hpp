// The frames of an MVNX file (Xsens) as its bytes come: numbers by element, one row a frame. What
// stands before and after the frames is another's to read.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/types.hpp"
#include "record/xml_scan.hpp"

namespace ulna {

// Numbers of one element of the frames in the units of the file, NaN where a frame lacks it.
struct MvnxTable {
  std::string element;
  Index width = 0;  // numbers a frame; 0: no frame has any
  std::vector<double> numbers;
};

// A frame that is no motion: "identity", "tpose" and the like.
struct MvnxPose {
  std::string kind;
  std::vector<double> orientation;  // as the file has it, or empty
  std::vector<double> position;
};

class MvnxFrames {
 public:
  // elements: those whose numbers are kept, as "orientation"; none: only poses are read.
  // first_line: of the file, where the bytes begin; name: of the file, for messages.
  MvnxFrames(std::string name, const std::vector<std::string>& elements, Index first_line);

  // The next bytes after the tag <frames>. Returns how many of them belong to the frames: fewer
  // than `size` once </frames> has come. Throws Error (kFormat) for what is no XML, no number, or a
  // row of another length, with its line or frame; after that nothing more is taken (kArgument).
  std::size_t push(const char* data, std::size_t size);

  bool done() const noexcept { return done_; }                  // </frames> has come
  Index frames() const noexcept { return std::ssize(index_); }  // of motion
  Index line() const noexcept;                                  // of the file, behind all bytes

  const std::vector<std::int64_t>& index() const noexcept { return index_; }
  const std::vector<double>& time_ms() const noexcept { return time_ms_; }  // NaN: none given
  const std::vector<MvnxTable>& tables() const noexcept { return tables_; }
  const std::vector<MvnxPose>& poses() const noexcept { return poses_; }

 private:
  // The row of the frame that is being read; it counts once the frame is whole.
  struct Row {
    std::string element;
    std::vector<double> numbers;
  };

  const char* take(const char* at, const char* end);
  bool take_frame(const XmlMarkup& tag, const char*& at, const char* end);
  bool take_pose(std::string_view frame, const std::string& kind, const char*& at, const char* end);
  bool take_rows(std::string_view frame, std::vector<Row>& rows, const std::string& where,
                 const char*& at, const char* end) const;
  bool take_numbers(std::string_view tag, Row& row, const std::string& where, const char*& at,
                    const char* end) const;
  bool pass_over(std::string_view tag, const char*& at, const char* end) const;
  void keep_motion(std::int64_t index, double time_ms);
  [[noreturn]] void refuse_markup(const char* at) const;

  std::string name_;
  std::vector<MvnxTable> tables_;
  std::vector<MvnxPose> poses_;
  std::vector<std::int64_t> index_;
  std::vector<double> time_ms_;
  std::vector<Row> rows_;        // of motion, one a table
  std::vector<Row> pose_rows_;   // orientation and position
  std::string pending_;          // bytes that are not a whole frame yet
  const char* begin_ = nullptr;  // of the bytes that line_ counts from
  Index line_ = 1;               // where what is pending begins
  bool done_ = false;
  bool refused_ = false;
};

}  // namespace ulna
