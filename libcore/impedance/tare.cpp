#include "impedance/tare.hpp"

#include <Eigen/LU>
#include <cmath>
#include <memory>

#include "base/error.hpp"
#include "base/words.hpp"
#include "ident/wide.hpp"
#include "impedance/natural.hpp"

namespace ulna {

namespace {

Index axes_of(const NaturalParameters& p, const char* argument) {
  for (Index n = 1; n <= 6; ++n) {
    if (natural_size(n) != p.value.size()) continue;
    require(p.covariance.rows() == p.value.size() && p.covariance.cols() == p.value.size(),
            argument,
            std::string(argument) + " needs a covariance of its " + std::to_string(p.value.size()) +
                " parameters");
    require(p.value.head(3 * n * n).allFinite() &&
                p.covariance.topLeftCorner(3 * n * n, 3 * n * n).allFinite(),
            argument, "M, B and K of " + std::string(argument) + " must be finite");
    return n;
  }
  throw Error(Fault::kArgument, argument,
              std::string(argument) + " has " + std::to_string(p.value.size()) +
                  " parameters; an impedance of n axes has 3 n^2 + n");
}

// M, B, K row by row and then c = K x0, which stays finite where K is singular.
struct Offsets {
  Vector value;
  Matrix covariance;
};

Offsets with_offsets(const NaturalParameters& p, Index n, const char* argument) {
  const Index first = 2 * n * n;
  const Index x0 = 3 * n * n;
  Offsets out{p.value, p.covariance};
  Matrix k(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) k(i, j) = p.value[first + i * n + j];
  }
  if (!p.value.tail(n).allFinite() || !p.covariance.allFinite()) {
    require(k.isZero(), argument,
            "x0 of " + std::string(argument) +
                " is not known though it has a stiffness: identify it with a structure that "
                "determines x0, or set its K to zero");
    out.value.tail(n).setZero();
    out.covariance.bottomRows(n).setZero();
    out.covariance.rightCols(n).setZero();
    return out;
  }
  out.value.tail(n) = k * p.value.tail(n);
  Matrix jacobian = Matrix::Identity(p.value.size(), p.value.size());
  jacobian.bottomRightCorner(n, n) = k;
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) jacobian(x0 + i, first + i * n + j) = p.value[x0 + j];
  }
  out.covariance = jacobian * p.covariance * jacobian.transpose();
  return out;
}

}  // namespace

NaturalParameters tare_impedance(const NaturalParameters& measured, const NaturalParameters& rig) {
  const Index n = axes_of(measured, "measured");
  require(axes_of(rig, "rig") == n, "rig",
          "the rig was identified in another number of axes than the measurement");
  const Offsets a = with_offsets(measured, n, "measured");
  const Offsets b = with_offsets(rig, n, "rig");
  NaturalParameters out{a.value - b.value, a.covariance + b.covariance};
  const Index first = 2 * n * n;
  const Index x0 = 3 * n * n;
  Matrix k(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) k(i, j) = out.value[first + i * n + j];
  }
  const Eigen::FullPivLU<Matrix> lu(k);
  if (!lu.isInvertible()) {
    out.value.tail(n).setConstant(kNaN);
    out.covariance.bottomRows(n).setConstant(kNaN);
    out.covariance.rightCols(n).setConstant(kNaN);
    return out;
  }
  const Vector place = lu.solve(out.value.tail(n));
  const Matrix inverse = lu.inverse();
  // K x0 = c: dx0 = K^-1 (dc - dK x0).
  Matrix jacobian = Matrix::Identity(out.value.size(), out.value.size());
  jacobian.bottomRightCorner(n, n) = inverse;
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      jacobian.block(x0, first + i * n + j, n, 1) = -inverse.col(i) * place[j];
    }
  }
  out.value.tail(n) = place;
  out.covariance = jacobian * out.covariance * jacobian.transpose();
  return out;
}

TaredRecord tare_record(const Record& record, const NaturalParameters& rig, const Roles& roles,
                        PrepareOptions options, int threads, Token* token) {
  const Index n = axes_of(rig, "rig");
  require(static_cast<Index>(roles.position.size()) == n, "rig",
          sentence(6, "the rig has ", n, " axes, the record ", roles.position.size()));
  const Offsets offsets = with_offsets(rig, n, "rig");
  options = wide_options(record, roles.position, options);
  Prepared prepared = prepare(record, {roles.position, roles.force, {}}, options, threads, token);
  drop_transients(prepared, record);

  // Rows with a full window, of the record's own channels; the motion is differentiated.
  Index rows = 0;
  for (const PreparedTrial& trial : prepared.trials) rows += trial.rows();
  Record::Parts parts;
  parts.values.resize(rows, record.channel_count());
  parts.channels = record.channels();
  parts.rate_hz = record.rate_hz();
  parts.provenance = record.provenance();
  const Index parameters = offsets.value.size();
  TaredRecord out{record, {}};
  ForceErrors& errors = out.errors;
  errors.covariance = offsets.covariance;
  errors.sensitivity.assign(static_cast<std::size_t>(parameters), Matrix::Zero(rows, n));
  const char* const terms[] = {"M", "B", "K"};
  for (Index term = 0; term < 3; ++term) {
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < n; ++j) {
        errors.names.push_back(sentence(6, "rig ", terms[term], "_", i + 1, j + 1));
      }
    }
  }
  for (Index i = 0; i < n; ++i) errors.names.push_back(sentence(6, "rig K x0_", i + 1));

  Index at = 0;
  for (std::size_t t = 0; t < prepared.trials.size(); ++t) {
    const PreparedTrial& trial = prepared.trials[t];
    auto values = parts.values.middleRows(at, trial.rows());
    values = record.values().middleRows(trial.begin(), trial.rows());
    const Matrix motion[] = {trial.acceleration(), trial.velocity(), trial.position()};
    for (Index i = 0; i < n; ++i) {
      auto force = values.col(roles.force[static_cast<std::size_t>(i)]);
      for (Index term = 0; term < 3; ++term) {
        for (Index j = 0; j < n; ++j) {
          const Index k = term * n * n + i * n + j;
          force += offsets.value[k] * motion[term].col(j);
          errors.sensitivity[static_cast<std::size_t>(k)].block(at, i, trial.rows(), 1) =
              motion[term].col(j);
        }
      }
      force.array() -= offsets.value[3 * n * n + i];
      errors.sensitivity[static_cast<std::size_t>(3 * n * n + i)]
          .block(at, i, trial.rows(), 1)
          .setConstant(-1.0);
    }
    const auto first = record.time().begin() + trial.begin();
    parts.time.insert(parts.time.end(), first, first + trial.rows());
    parts.trials.push_back({at, at + trial.rows()});
    for (const Segment& segment : record.segments()) {
      if (segment.trial != static_cast<int>(t)) continue;
      const Index begin = std::max<Index>(segment.begin - trial.begin(), 0);
      const Index end = std::min(segment.end - trial.begin(), trial.rows());
      if (begin < end) parts.segments.push_back({at + begin, at + end, static_cast<int>(t)});
    }
    at += trial.rows();
  }
  parts.provenance.push_back(
      sentence(6, "tared: M_r x'' + B_r x' + K_r (x - x_r) of the empty rig added to the force, ",
               "motion differentiated with a low pass at ", prepared.report.lowpass_hz, " Hz, ",
               prepared.report.dropped_rows, " rows dropped at either end of a trial"));
  out.record = Record::make(std::move(parts));
  return out;
}

}  // namespace ulna
