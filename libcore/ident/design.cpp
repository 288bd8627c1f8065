#include "ident/design.hpp"

namespace ulna {

Index row_count(const std::vector<Span>& spans) {
  Index rows = 0;
  for (const Span& span : spans) rows += span.end - span.begin;
  return rows;
}

Design::Design(const Prepared& prepared, double payload_kg, const std::vector<Span>& spans)
    : prepared_(&prepared),
      payload_kg_(payload_kg),
      n_(static_cast<Index>(prepared.roles.position.size())),
      m_(static_cast<Index>(prepared.roles.reference.size())),
      q_(m_ >= n_ ? 3 * m_ + 1 : 0),
      position_mean_(Vector::Zero(n_)),
      reference_mean_(Vector::Zero(m_)) {
  for (const Span& span : spans) {
    const PreparedTrial& trial = prepared.trials[static_cast<std::size_t>(span.trial)];
    const Index rows = span.end - span.begin;
    position_mean_ += trial.position().middleRows(span.begin, rows).colwise().sum().transpose();
    reference_mean_ += trial.reference().middleRows(span.begin, rows).colwise().sum().transpose();
  }
  const double rows = static_cast<double>(row_count(spans));
  position_mean_ /= rows;
  reference_mean_ /= rows;
}

void Design::fill(int index, Index row, Index count, Eigen::Ref<Matrix> out) const {
  const PreparedTrial& trial = prepared_->trials[static_cast<std::size_t>(index)];
  Index c = 0;
  const auto put = [&](const auto& signals) {
    out.middleCols(c, signals.cols()) = signals.middleRows(row, count);
    c += signals.cols();
  };
  if (q_ > 0) {
    put(trial.reference_acceleration());
    put(trial.reference_rate());
    put(trial.reference());
    out.middleCols(c - m_, m_).rowwise() -= reference_mean_.transpose();
    out.col(c++).setOnes();
  }
  put(trial.acceleration());
  put(trial.velocity());
  put(trial.position());
  out.middleCols(c - n_, n_).rowwise() -= position_mean_.transpose();
  out.col(c++).setOnes();
  out.middleCols(c, n_) = -trial.force().middleRows(row, count) -
                          payload_kg_ * trial.acceleration().middleRows(row, count);
}

}  // namespace ulna
