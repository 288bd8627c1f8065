// A matrix whose size changes from step to step, in storage that only grows: steps take memory
// from the system and give it back nowhere, which would also make threads wait for each other.
#pragma once

#include "base/types.hpp"

namespace ulna {

class GrowingMatrix {
 public:
  // What it held is lost.
  void resize(Index rows, Index columns) {
    rows_ = rows;
    columns_ = columns;
    if (rows * columns > storage_.size()) storage_.resize(rows * columns);
  }
  Eigen::Map<Matrix> view() { return {storage_.data(), rows_, columns_}; }
  Eigen::Map<const Matrix> view() const { return {storage_.data(), rows_, columns_}; }

 private:
  Vector storage_;
  Index rows_ = 0;
  Index columns_ = 0;
};

}  // namespace ulna
