// What is uncertain about a force that was computed rather than read: constants that are wrong by
// the same amount in every row of a recording, and so do not average out.
#pragma once

#include <string>
#include <vector>

#include "base/types.hpp"

namespace ulna {

// Force error of a row: sum over k of sensitivity[k].row(row) * e_k, with covariance of e. Rows are
// those of the record that holds the force, columns its axes, units N per unit of e_k.
struct ForceErrors {
  std::vector<std::string> names;
  std::vector<Matrix> sensitivity;
  Matrix covariance;
};

// Standard deviation of the force from the errors of all names that begin with `group` ("": all),
// rows x axes.
inline Matrix systematic_error(const ForceErrors& errors, const std::string& group = {}) {
  if (errors.sensitivity.empty()) return {};
  Matrix sum = Matrix::Zero(errors.sensitivity[0].rows(), errors.sensitivity[0].cols());
  for (std::size_t i = 0; i < errors.names.size(); ++i) {
    for (std::size_t j = 0; j < errors.names.size(); ++j) {
      if (!errors.names[i].starts_with(group) || !errors.names[j].starts_with(group)) continue;
      const double c = errors.covariance(static_cast<Index>(i), static_cast<Index>(j));
      if (c != 0.0) sum += c * errors.sensitivity[i].cwiseProduct(errors.sensitivity[j]);
    }
  }
  return sum.cwiseMax(0.0).cwiseSqrt();
}

}  // namespace ulna
