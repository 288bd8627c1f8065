#include "ident/sensor_check.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"
#include "record/append.hpp"
#include "signal/butterworth.hpp"
#include "signal/zero_phase.hpp"

namespace ulna {

namespace {

constexpr double kGravity = 9.80665;
constexpr int kHighpassOrder = 3;
constexpr int kDriftOrder = 3;         // polynomial of a twice integrated bias and its start values
constexpr Index kLeastCompared = 200;  // rows of a trial: ten for each block
constexpr Index kJackknifeBlocks = 20;  // of the jackknife
constexpr double kSure = 3.0;           // standard errors
constexpr double kVisibleScale = 0.02;
constexpr double kVisibleTurn = 2.0 * kPi / 180.0;

// Integral of evenly spaced samples by cubics through four neighbours: error (omega h)^4 11 / 720,
// 1e-8 at 5 Hz and 1 kHz.
Matrix integral(const Matrix& y, double step) {
  const Index rows = y.rows();
  Matrix out = Matrix::Zero(rows, y.cols());
  for (Index i = 1; i < rows; ++i) {
    if (i == 1 || i == rows - 1) {
      out.row(i) = out.row(i - 1) + 0.5 * step * (y.row(i - 1) + y.row(i));
    } else {
      out.row(i) = out.row(i - 1) +
                   step / 24.0 * (13.0 * (y.row(i - 1) + y.row(i)) - y.row(i - 2) - y.row(i + 1));
    }
  }
  return out;
}

// Takes out a polynomial and then everything slow; the same linear operator on every column.
void remove_drift(const Sos& slow, Matrix& signals) {
  const Index rows = signals.rows();
  Matrix powers(rows, kDriftOrder + 1);
  for (Index i = 0; i < rows; ++i) {
    const double t = 2.0 * static_cast<double>(i) / static_cast<double>(rows - 1) - 1.0;
    double power = 1.0;
    for (Index k = 0; k <= kDriftOrder; ++k, power *= t) powers(i, k) = power;
  }
  const Eigen::HouseholderQR<Matrix> qr(powers);
  const Matrix basis = qr.householderQ() * Matrix::Identity(rows, kDriftOrder + 1);
  signals -= basis * (basis.transpose() * signals);
  Matrix low = signals;
  filter_zero_phase(slow, {}, low);
  signals -= low;
}

// Rows of one trial after integration, thinned: p, x.
struct Pair {
  Matrix p, x;
};

// x at row + shift (not whole), by the cubic through four neighbours.
double at_shift(const Matrix& x, Index row, Index column, Index whole, double part) {
  const Index i = row + whole;
  const double a = x(i - 1, column);
  const double b = x(i, column);
  const double c = x(i + 1, column);
  const double d = x(i + 2, column);
  return b +
         0.5 * part *
             (c - a + part * (2.0 * a - 5.0 * b + 4.0 * c - d + part * (3.0 * (b - c) + d - a)));
}

// Regressions of p_i(t) on x(t - lag).
class Comparison {
 public:
  Comparison(std::vector<Pair> pairs, double rate, Index margin)
      : pairs_(std::move(pairs)), rate_(rate), margin_(margin), n_(pairs_[0].x.cols()) {}

  // Share of p_i left by the best gains at this lag, and those gains.
  double rest(Index i, double lag, Vector* gain = nullptr) const {
    Matrix gram = Matrix::Zero(n_ + 1, n_ + 1);
    visit(i, lag, [&](const Pair&, Index, const Vector& row) { gram += row * row.transpose(); });
    const Vector g = gram.topLeftCorner(n_, n_).ldlt().solve(gram.topRightCorner(n_, 1));
    if (gain != nullptr) *gain = g;
    return (gram(n_, n_) - g.dot(gram.topRightCorner(n_, 1).col(0))) / gram(n_, n_);
  }

  double best_lag(Index i, double most) const {
    const double step = 1.0 / rate_;
    double best = 0.0;
    double least = rest(i, 0.0);
    const auto steps = static_cast<Index>(most / step);
    for (Index k = -steps; k <= steps; ++k) {
      const double value = rest(i, static_cast<double>(k) * step);
      if (value < least) {
        least = value;
        best = static_cast<double>(k) * step;
      }
    }
    constexpr double kGolden = 0.6180339887498949;
    double low = best - step;
    double high = best + step;
    for (int k = 0; k < 30; ++k) {
      const double a = high - kGolden * (high - low);
      const double b = low + kGolden * (high - low);
      const bool first = rest(i, a) < rest(i, b);
      (first ? high : low) = first ? b : a;
    }
    return 0.5 * (low + high);
  }

  // Standard errors of gains and lag by leaving out one block at a time (delete-one jackknife of
  // the regression linearised in the lag).
  void errors(Index i, double lag, const Vector& gain, Vector& gain_error,
              double& lag_error) const {
    std::vector<Matrix> blocks(kJackknifeBlocks, Matrix::Zero(n_ + 2, n_ + 2));
    Index total = 0;
    for (const Pair& pair : pairs_) total += std::max<Index>(pair.x.rows() - 2 * margin_, 0);
    const double h = 0.5 / rate_;
    Index seen = 0;
    visit(i, lag, [&](const Pair& pair, Index row, const Vector& values) {
      double slope = 0.0;
      for (Index j = 0; j < n_; ++j) {
        slope -=
            gain[j] * (shifted(pair, row, j, lag - h) - shifted(pair, row, j, lag + h)) / (2.0 * h);
      }
      Vector all(n_ + 2);
      all << values.head(n_), slope, values[n_];
      blocks[static_cast<std::size_t>(std::min(
          kJackknifeBlocks - 1, seen * kJackknifeBlocks / total))] += all * all.transpose();
      ++seen;
    });
    Matrix sum = Matrix::Zero(n_ + 2, n_ + 2);
    for (const Matrix& block : blocks) sum += block;
    Matrix estimates(kJackknifeBlocks, n_ + 1);
    for (Index b = 0; b < kJackknifeBlocks; ++b) {
      const Matrix left = sum - blocks[static_cast<std::size_t>(b)];
      estimates.row(b) = left.topLeftCorner(n_ + 1, n_ + 1)
                             .ldlt()
                             .solve(left.topRightCorner(n_ + 1, 1))
                             .transpose();
    }
    const Matrix centred = estimates.rowwise() - estimates.colwise().mean();
    const double factor =
        static_cast<double>(kJackknifeBlocks - 1) / static_cast<double>(kJackknifeBlocks);
    const Vector error = (factor * centred.colwise().squaredNorm()).cwiseSqrt().transpose();
    gain_error = error.head(n_);
    lag_error = error[n_];
  }

  double correlation(Index i, Index j, double lag) const {
    double pp = 0.0;
    double xx = 0.0;
    double px = 0.0;
    visit(i, lag, [&](const Pair&, Index, const Vector& row) {
      pp += row[n_] * row[n_];
      xx += row[j] * row[j];
      px += row[n_] * row[j];
    });
    return pp > 0.0 && xx > 0.0 ? px / std::sqrt(pp * xx) : 0.0;
  }

  // Percent of the variance of p that x accounts for with unit gain and no lag.
  double plain_agreement(Index i) const {
    double left = 0.0;
    double all = 0.0;
    visit(i, 0.0, [&](const Pair&, Index, const Vector& row) {
      left += (row[n_] - row[i]) * (row[n_] - row[i]);
      all += row[i] * row[i];
    });
    return 100.0 * (1.0 - left / all);
  }

 private:
  double shifted(const Pair& pair, Index row, Index column, double lag) const {
    const double shift = -lag * rate_;
    const double whole = std::floor(shift);
    return at_shift(pair.x, row, column, static_cast<Index>(whole), shift - whole);
  }

  // row: x(t - lag) and then p_i(t).
  template <class Visit>
  void visit(Index i, double lag, const Visit& use) const {
    Vector row(n_ + 1);
    for (const Pair& pair : pairs_) {
      for (Index k = margin_; k < pair.x.rows() - margin_; ++k) {
        for (Index j = 0; j < n_; ++j) row[j] = shifted(pair, k, j, lag);
        row[n_] = pair.p(k, i);
        use(pair, k, row);
      }
    }
  }

  std::vector<Pair> pairs_;
  double rate_;
  Index margin_;
  Index n_;
};

class Words {
 public:
  explicit Words(SensorCheck& out) : out_(out) {}

  void say(Disagreement kind, Severity severity, const char* code, Index axis,
           const std::string& message) {
    Finding finding;
    finding.severity = severity;
    finding.code = code;
    finding.channel = axis < 0 ? "" : out_.accelerations[static_cast<std::size_t>(axis)];
    finding.message = message;
    out_.findings.push_back(std::move(finding));
    if (severity == Severity::kNote) return;
    if (out_.worst == Disagreement::kNone || kind < out_.worst) out_.worst = kind;
  }

 private:
  SensorCheck& out_;
};

bool near(double value, double target) { return std::abs(value / target - 1.0) < 0.1; }

void explain_axis(SensorCheck& out, Words& words, Index i, bool turned) {
  const std::string& a = out.accelerations[static_cast<std::size_t>(i)];
  const Index j = out.follows[static_cast<std::size_t>(i)];
  const std::string& x = out.positions[static_cast<std::size_t>(j)];
  const double correlation = std::abs(out.correlation(i, j));
  if (!(out.corrected[i] >= 50.0)) {
    words.say(Disagreement::kUnrelated, Severity::kError, "unrelated", i,
              sentence(3, a, " does not follow the motion of the encoders (correlation ",
                       correlation, " at best): the sensor was not connected, not fixed to the ",
                       "handle, or the motion is too small for it"));
    return;
  }
  const double own = std::abs(out.correlation(i, i));
  if (j != i && !turned) {
    words.say(Disagreement::kAxes, Severity::kError, "axes", i,
              sentence(3, a, " follows ", x, " (correlation ", correlation, ") and not ",
                       out.positions[static_cast<std::size_t>(i)], " (", own,
                       "): its axes are exchanged, exchange the channels"));
  }
  const double scale = out.scale[i];
  if (scale < 0.0 && !turned) {
    words.say(Disagreement::kSign, Severity::kError, "sign", i,
              sentence(3, a, " is opposite to the motion along ", x,
                       ": its sign is reversed, read it with sign -1"));
  }
  const double size = std::abs(scale);
  const double error = out.gain_error(i, j);
  const struct {
    double factor;
    const char* text;
  } units[] = {
      {1.0 / kGravity, "looks as if it were in g: multiply it by 9.80665 to have m/s^2"},
      {kGravity, "is 9.8 times too large, as if m/s^2 had been taken for g and multiplied again"},
      {1e-3, "is a thousand times too small: check m/s^2 against mm/s^2"},
      {1e3, "is a thousand times too large: check m/s^2 against mm/s^2"},
      {1e3 / kGravity, "looks as if it were in milli-g: multiply it by 0.00980665"},
  };
  bool unit = false;
  for (const auto& candidate : units) {
    if (!near(size, candidate.factor)) continue;
    unit = true;
    words.say(Disagreement::kUnit, Severity::kError, "unit", i,
              sentence(4, a, " ", candidate.text, " (gain ", scale, ")"));
  }
  if (!unit && !turned && std::abs(size - 1.0) > std::max(kSure * error, kVisibleScale)) {
    words.say(Disagreement::kScale, Severity::kWarning, "scale", i,
              sentence(3, a, " is ", 100.0 * std::abs(size - 1.0), " % too ",
                       size > 1.0 ? "large" : "small", " against the encoder (gain ", size, " +- ",
                       error, "): correct its sensitivity by a factor of ", 1.0 / size));
  }
}

}  // namespace

SensorCheck check_sensors(const Record& record, const SensorCheckOptions& options, Token* token) {
  const std::vector<Index> position = options.position.empty()
                                          ? record.with_role(Role::kPosition)
                                          : channels_of(record, options.position, "position");
  require(!options.acceleration.empty(), "acceleration",
          "name the channels of the accelerometer, as \"a\" for a_x and a_y");
  const std::vector<Index> acceleration = channels_of(record, options.acceleration, "acceleration");
  const Index n = static_cast<Index>(position.size());
  require(n >= 1 && n <= 3, "position",
          "there are " + std::to_string(n) + " positions: one to three axes are compared");
  require(acceleration.size() == position.size(), "acceleration",
          "there are " + std::to_string(acceleration.size()) + " accelerations and " +
              std::to_string(n) + " positions: every axis needs one of each");
  require_unit(record, position, "m", "compare with positions of the handle, not joint angles");
  for (const Index c : acceleration) {
    const std::string& unit = record.channels()[static_cast<std::size_t>(c)].unit;
    if (unit.empty() || unit == "1") continue;
    require_unit(record, {c}, "m/s^2", "name the channels of the accelerometer");
  }
  require(options.max_lag_s > 0.0 && options.max_lag_s <= 2.0, "max_lag_s",
          "the lag to look for must be above 0 and at most 2 s");
  require(options.highpass_hz >= 0.0 && std::isfinite(options.highpass_hz), "highpass_hz",
          "the high pass must be a positive frequency, or 0 to choose it");

  // Both through the same smoother. The accelerations stand where a force would.
  const Prepared prepared =
      prepare(record, {position, acceleration, {}}, options.prepare, options.threads, token);
  const double rate = record.rate_hz();
  SensorCheck out;
  out.lowpass_hz = prepared.report.lowpass_hz;
  const double slowest = motion_band(record, position, 0.05, 0.2 * rate);
  out.highpass_hz =
      options.highpass_hz > 0.0 ? options.highpass_hz : std::clamp(0.5 * slowest, 0.2, 1.0);
  const double top = out.lowpass_hz > 0.0 ? out.lowpass_hz : 0.1 * rate;
  require(out.highpass_hz < 0.5 * top, "highpass_hz",
          sentence(4, "the high pass at ", out.highpass_hz,
                   " Hz leaves nothing below the low pass ", "at ", top, " Hz"));
  for (const Index c : position)
    out.positions.push_back(record.channels()[static_cast<std::size_t>(c)].name);
  for (const Index c : acceleration)
    out.accelerations.push_back(record.channels()[static_cast<std::size_t>(c)].name);

  // Thinned to forty samples a period of the fastest motion: cubics between them err by 1e-5.
  const Index stride = std::max<Index>(1, static_cast<Index>(rate / (40.0 * top)));
  const double thin = rate / static_cast<double>(stride);
  const Sos slow = butterworth_lowpass(kHighpassOrder, out.highpass_hz, rate);
  std::vector<Pair> pairs;
  out.offset = Vector::Zero(n);
  Index rows = 0;
  for (const PreparedTrial& trial : prepared.trials) {
    step(token, 0.2);
    if (static_cast<double>(trial.rows()) < 8.0 * rate / out.highpass_hz) continue;
    Matrix both(trial.rows(), 2 * n);
    both.leftCols(n) = integral(integral(trial.force(), 1.0 / rate), 1.0 / rate);
    both.rightCols(n) = trial.position();
    remove_drift(slow, both);
    const Index count = trial.rows() / stride;
    const auto every = Eigen::seqN(Index{0}, count, stride);
    pairs.push_back({both(every, Eigen::seqN(Index{0}, n)), both(every, Eigen::seqN(n, n))});
    out.offset += trial.force().colwise().sum().transpose();
    rows += trial.rows();
    if (pairs.size() > 1) continue;
    out.trace.resize(count, 1 + 2 * n);
    for (Index i = 0; i < count; ++i) {
      out.trace(i, 0) = record.time()[static_cast<std::size_t>(trial.begin() + i * stride)];
    }
    out.trace.middleCols(1, n) = pairs[0].p;
    out.trace.rightCols(n) = pairs[0].x;
  }
  if (pairs.empty()) {
    throw Error(Fault::kData, "time",
                sentence(4, "no trial lasts the ", 8.0 / out.highpass_hz,
                         " s that removing the drift below ", out.highpass_hz,
                         " Hz takes: record longer, or raise the high pass"));
  }
  out.offset /= static_cast<double>(rows);

  // The ends carry the extension of the high pass; a lag reaches beyond a row as well.
  const Index margin = static_cast<Index>(std::ceil(options.max_lag_s * thin)) + 4 +
                       static_cast<Index>(thin / out.highpass_hz);
  std::erase_if(pairs,
                [margin](const Pair& pair) { return pair.x.rows() < 2 * margin + kLeastCompared; });
  if (pairs.empty()) {
    throw Error(
        Fault::kData, "time",
        sentence(4, "no trial is longer than the ", 2.0 * options.max_lag_s,
                 " s of the lag and the ", 2.0 / out.highpass_hz,
                 " s of the high pass at its ends: record longer, or look for a smaller lag"));
  }
  const Comparison comparison(pairs, thin, margin);
  out.gain.resize(n, n);
  out.gain_error.resize(n, n);
  out.correlation.resize(n, n);
  out.lag_s.resize(n);
  out.lag_error_s.resize(n);
  out.agreement.resize(n);
  out.corrected.resize(n);
  out.scale.resize(n);
  for (Index i = 0; i < n; ++i) {
    step(token, 0.3 + 0.6 * static_cast<double>(i) / static_cast<double>(n));
    out.lag_s[i] = comparison.best_lag(i, options.max_lag_s);
    Vector gain;
    out.corrected[i] = 100.0 * (1.0 - comparison.rest(i, out.lag_s[i], &gain));
    out.gain.row(i) = gain.transpose();
    Vector error;
    comparison.errors(i, out.lag_s[i], gain, error, out.lag_error_s[i]);
    out.gain_error.row(i) = error.transpose();
    for (Index j = 0; j < n; ++j) {
      out.correlation(i, j) = comparison.correlation(i, j, out.lag_s[i]);
    }
    out.agreement[i] = comparison.plain_agreement(i);
    // By gain and not by correlation: axes of one motion may be correlated with each other.
    Index best = 0;
    gain.cwiseAbs().maxCoeff(&best);
    out.follows.push_back(best);
    out.scale[i] = gain[best];
  }

  Words words(out);
  bool turned = false;
  if (n == 2 && out.corrected.minCoeff() >= 50.0) {
    // The nearest rotation of the gains: its angle is atan2 of their antisymmetric part.
    const double sine = out.gain(0, 1) - out.gain(1, 0);
    const double cosine = out.gain(0, 0) + out.gain(1, 1);
    const double size = std::hypot(sine, cosine);
    // Reflections (one sign, exchanged axes) leave little of that; they are told apart below.
    const double reflection =
        std::hypot(out.gain(0, 0) - out.gain(1, 1), out.gain(0, 1) + out.gain(1, 0));
    out.turned_rad = std::atan2(sine, cosine);
    const double spread = out.gain_error.norm() / std::sqrt(2.0);
    out.turned_error_rad = size > 0.0 ? spread / (0.5 * size) * std::sqrt(0.5) : 0.0;
    const double angle = std::abs(out.turned_rad);
    const bool right =
        std::abs(angle - 0.5 * kPi) < kVisibleTurn || std::abs(angle - kPi) < kVisibleTurn;
    turned = reflection < 0.3 * size && !right &&
             angle > std::max(kSure * out.turned_error_rad, kVisibleTurn);
    if (turned) {
      words.say(
          Disagreement::kTurned, Severity::kWarning, "turned", -1,
          sentence(3, "the accelerometer's axes are turned against those of the encoders by ",
                   out.turned_rad * 180.0 / kPi, " deg (+- ", out.turned_error_rad * 180.0 / kPi,
                   "): turn its channels back, or fix it in line"));
    }
  }
  for (Index i = 0; i < n; ++i) explain_axis(out, words, i, turned);
  for (Index i = 0; i < n; ++i) {
    const std::string& a = out.accelerations[static_cast<std::size_t>(i)];
    if (!(out.corrected[i] >= 50.0)) continue;
    const double late = out.lag_s[i];
    if (std::abs(late) > std::max(kSure * out.lag_error_s[i], 0.5 / rate)) {
      words.say(
          Disagreement::kLag, Severity::kWarning, "lag", i,
          sentence(3, a, " is ", 1e3 * std::abs(late), " ms ", late > 0.0 ? "later" : "earlier",
                   " than the encoder (+- ", 1e3 * out.lag_error_s[i],
                   " ms): shift it, or the filter in front of it biases the inertia"));
    }
    if (std::abs(out.offset[i]) > 0.1 * std::max(1.0, std::abs(out.scale[i]))) {
      const double tilt = std::asin(std::clamp(out.offset[i] / kGravity, -1.0, 1.0));
      words.say(Disagreement::kNone, Severity::kNote, "offset", i,
                sentence(3, a, " has a mean of ", out.offset[i], " m/s^2: a bias, or a tilt of ",
                         tilt * 180.0 / kPi, " deg against the horizontal; it drops out here"));
    }
  }
  return out;
}

}  // namespace ulna
