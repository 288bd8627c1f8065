#include "study/paired.hpp"

#include <cmath>
#include <string>

#include "base/error.hpp"

namespace ulna {
namespace {

constexpr Index kPairFeatures = 3;    // first, second, squared difference
constexpr Index kPairStatistics = 3;  // difference, relative, standardised

void check_pairs(MatrixRef first, MatrixRef second) {
  require(first.rows() == second.rows() && first.cols() == second.cols(), "second",
          "the second condition has " + std::to_string(second.rows()) + " x " +
              std::to_string(second.cols()) + " values, the first " + std::to_string(first.rows()) +
              " x " + std::to_string(first.cols()) + ": the same subjects and measures are needed");
  require(first.rows() >= 3 && first.cols() >= 1, "first",
          "a comparison needs at least 3 subjects and 1 measure");
  for (const MatrixRef* values : {&first, &second}) {
    for (Index i = 0; i < values->rows(); ++i) {
      for (Index j = 0; j < values->cols(); ++j) {
        if (std::isfinite((*values)(i, j))) continue;
        const std::string where = "subject " + std::to_string(i) + ", measure " + std::to_string(j);
        throw Error(Fault::kData, values == &first ? "first" : "second",
                    "the value of " + where + " is no finite number: leave the subject out", where);
      }
    }
  }
}

void evaluate_pair(const double* means, Index subjects, double centre, double* out) {
  const double difference = means[1] - means[0];  // less the centre of the whole sample
  const auto n = static_cast<double>(subjects);
  const double variance = (means[2] - difference * difference) * n / (n - 1.0);
  const double change = difference + centre;
  out[0] = change;
  out[1] = change / means[0];
  out[2] = variance > 0.0 ? change / std::sqrt(variance) : kNaN;
}

Estimates every_third(const Estimates& all, Index which) {
  const auto part = [which](const Vector& v) {
    return Vector(v(Eigen::seq(which, Eigen::last, Eigen::fix<kPairStatistics>)));
  };
  return {part(all.value), part(all.error), part(all.low), part(all.high)};
}

}  // namespace

PairedEstimates paired_estimates(MatrixRef first, MatrixRef second, const IntervalSpec& spec,
                                 Token* token) {
  check_pairs(first, second);
  require(spec.kind == IntervalKind::kBca || spec.kind == IntervalKind::kPercentile, "interval",
          "a paired comparison has bootstrap intervals only");
  const Index measures = first.cols();
  // Centred differences keep the digits of a small spread about a large change.
  const Eigen::RowVectorXd centre = (second - first).colwise().mean();
  Matrix table(first.rows(), kPairFeatures * measures);
  for (Index m = 0; m < measures; ++m) {
    const Vector difference = (second.col(m) - first.col(m)).array() - centre[m];
    table.col(kPairFeatures * m) = first.col(m);
    table.col(kPairFeatures * m + 1) = first.col(m) + difference;
    table.col(kPairFeatures * m + 2) = difference.cwiseAbs2();
  }
  BlockFeatures blocks;
  blocks.blocks = first.rows();
  blocks.features = table.cols();
  blocks.statistics = kPairStatistics * measures;
  blocks.fill = [&table](Index from, Eigen::Ref<Matrix> out) {
    out = table.middleRows(from, out.rows());
  };
  blocks.evaluate = [&centre, measures](const double* means, Index n, double* out) {
    for (Index m = 0; m < measures; ++m) {
      evaluate_pair(means + kPairFeatures * m, n, centre[m], out + kPairStatistics * m);
    }
  };
  const Estimates all = estimate_of_blocks(blocks, spec, token);
  return {every_third(all, 0), every_third(all, 1), every_third(all, 2)};
}

}  // namespace ulna
