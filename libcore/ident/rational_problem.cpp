#include "ident/rational_problem.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

constexpr int kMostPoles = 10;

// Squares of a free response that has decayed below this are zero: nothing of it is left in a
// double, and numbers that are no longer normal take a hundred times as long.
constexpr double kGone = 1e-44;

Matrix companion(const Vector& a) {
  const Index n = a.size();
  Matrix f = Matrix::Zero(n, n);
  for (Index i = 0; i + 1 < n; ++i) f(i, i + 1) = 1.0;
  f.row(n - 1) = -a.transpose();
  return f;
}

// Two filters in a row: the second is driven by `output` of the first one's states.
Matrix cascade(const Matrix& f, const Vector& output) {
  const Index n = f.rows();
  Matrix both = Matrix::Zero(2 * n, 2 * n);
  both.topLeftCorner(n, n) = f;
  both.bottomRightCorner(n, n) = f;
  both.row(2 * n - 1).head(n) = output.transpose();
  return both;
}

// Pseudo-inverse of a Gram matrix, columns to unit length first. Directions below 1e-13 of the
// largest are rounding: the squares of what is left of them.
Matrix gram_inverse(const Matrix& gram) {
  if (gram.rows() == 0) return gram;
  const Vector scale =
      gram.diagonal().unaryExpr([](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 0.0; });
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(scale.asDiagonal() * gram *
                                                     scale.asDiagonal());
  const double least = 1e-13 * solver.eigenvalues().cwiseAbs().maxCoeff();
  const Vector inverse =
      solver.eigenvalues().unaryExpr([least](double v) { return v > least ? 1.0 / v : 0.0; });
  const Matrix v = scale.asDiagonal() * solver.eigenvectors();
  return v * inverse.asDiagonal() * v.transpose();
}

void check_setup(const RationalSetup& setup, Index inputs) {
  const RationalOrders& o = setup.orders;
  require(o.poles >= 1 && o.poles <= kMostPoles, "poles",
          sentence(6, "poles is ", o.poles, "; it must be from 1 to ", kMostPoles));
  require(static_cast<Index>(o.zeros.size()) == inputs, "zeros",
          sentence(6, "zeros has ", o.zeros.size(), " entries for ", inputs, " inputs"));
  require(static_cast<Index>(o.delay_s.size()) == inputs, "delay_s",
          sentence(6, "delay_s has ", o.delay_s.size(), " entries for ", inputs, " inputs"));
  for (const Index m : o.zeros) {
    require(m >= 0 && m <= o.poles, "zeros",
            sentence(6, "zeros is ", m, " with ", o.poles,
                     " poles; it must be from 0 to the number of poles: a system with more zeros "
                     "than poles is identified with input and output exchanged"));
  }
  for (const double delay : o.delay_s) {
    require(std::isfinite(delay) && delay >= 0.0, "delay_s",
            "delay_s must be finite and not negative");
  }
  require(setup.held_out >= 0.0 && setup.held_out < 0.9, "held_out",
          "held_out must be a share from 0 to below 0.9");
  require(setup.least_skip_s >= 0.0 && std::isfinite(setup.least_skip_s), "skip_s",
          "skip_s must be finite and not negative");
}

void check_finite(MatrixRef signals, const char* what) {
  for (Index c = 0; c < signals.cols(); ++c) {
    for (Index r = 0; r < signals.rows(); ++r) {
      if (std::isfinite(signals(r, c))) continue;
      throw Error(Fault::kData, what,
                  sentence(6, what, " holds a missing or infinite value at row ", r, ", channel ",
                           c, ": split the record there"),
                  sentence(6, "row ", r, ", channel ", c));
    }
  }
}

// Calls with the number of states at compile time, 0 when it is known at run time only: loops over
// states are then unrolled for the orders that people use. Plain arrays keep compilation short.
template <class Call>
void for_order(Index n, const Call& call) {
  switch (n) {
    case 1:
      return call.template operator()<1>();
    case 2:
      return call.template operator()<2>();
    case 3:
      return call.template operator()<3>();
    case 4:
      return call.template operator()<4>();
    case 5:
      return call.template operator()<5>();
    case 6:
      return call.template operator()<6>();
    default:
      return call.template operator()<0>();
  }
}

// A vector of n states, n = N unless N is 0.
template <int N>
struct State {
  static constexpr int kSize = N == 0 ? kMostPoles : N;
  double v[kSize] = {};

  double& operator[](int i) { return v[i]; }
  double operator[](int i) const { return v[i]; }
};

template <int N>
State<N> state_of(const Vector& x) {
  State<N> out;
  for (int i = 0; i < static_cast<int>(x.size()); ++i) out[i] = x[i];
  return out;
}

// A square matrix of them by columns.
template <int N>
struct Square {
  State<N> column[State<N>::kSize];
};

template <int N>
Square<N> square_of(const Matrix& x) {
  Square<N> out;
  for (int j = 0; j < static_cast<int>(x.cols()); ++j) out.column[j] = state_of<N>(x.col(j));
  return out;
}

// to += m x
template <int N>
inline void add_product(const Square<N>& m, const State<N>& x, State<N>& to, int n) {
  const int count = N == 0 ? n : N;
  for (int j = 0; j < count; ++j) {
    for (int i = 0; i < count; ++i) to[i] += m.column[j][i] * x[j];
  }
}

// to += weight x
template <int N>
inline void add(double weight, const State<N>& x, State<N>& to, int n) {
  const int count = N == 0 ? n : N;
  for (int i = 0; i < count; ++i) to[i] += weight * x[i];
}

template <int N>
inline double dot(const State<N>& x, const double* y, int n) {
  const int count = N == 0 ? n : N;
  double sum = 0.0;
  for (int i = 0; i < count; ++i) sum += x[i] * y[i];
  return sum;
}

double variation(const Vector& y) { return (y.array() - y.mean()).square().sum(); }

}  // namespace

Index RationalOrders::parameters() const {
  Index count = poles;
  for (const Index m : zeros) count += m + 1;
  return count;
}

RationalProblem::RationalProblem(MatrixRef inputs, VectorRef output, double rate_hz,
                                 const std::vector<RowRange>& ranges, const RationalSetup& setup)
    : setup_(setup), rate_hz_(rate_hz) {
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "rate_hz", "rate_hz must be positive");
  require(inputs.cols() >= 1, "inputs", "there must be at least one input");
  require(inputs.rows() == output.size(), "output",
          sentence(12, "the inputs have ", inputs.rows(), " rows and the output ", output.size()));
  check_setup(setup, inputs.cols());
  n_ = setup.orders.poles;
  parameters_ = setup.orders.parameters();
  states_ = setup.rest ? 0 : n_;
  nuisance_ = states_ + (setup.offset ? 1 : 0);

  const double longest =
      *std::max_element(setup.orders.delay_s.begin(), setup.orders.delay_s.end());
  require(longest * rate_hz < static_cast<double>(output.size()), "delay_s",
          sentence(6, "the delay of ", longest, " s is longer than the record"));
  Index row = 2 * n_;
  for (Index i = 0; i < inputs.cols(); ++i) {
    const auto place = static_cast<std::size_t>(i);
    delays_.push_back(split_delay(setup.orders.delay_s[place], rate_hz));
    first_row_.push_back(row);
    row += setup.orders.zeros[place] + 1;
  }
  // At rest the input before the run is known: zero.
  const double unknown = setup.rest ? 0.0 : longest;
  const double left_out = std::ceil(std::max(unknown, setup.least_skip_s) * rate_hz - 1e-9);
  const Index skip = static_cast<Index>(std::min(left_out, static_cast<double>(output.size())));

  const std::vector<RowRange> used =
      ranges.empty() ? std::vector<RowRange>{{0, output.size()}} : ranges;
  Index last_end = 0;
  double total = 0.0;
  double square = 0.0;
  for (const RowRange& range : used) {
    require(range.begin >= last_end && range.end > range.begin && range.end <= output.size(),
            "ranges", "ranges must be in order, not overlap, and lie within the rows");
    last_end = range.end;
    RationalRun run;
    run.begin = range.begin;
    const Index rows = range.end - range.begin;
    run.skip = skip;
    run.fit_end = rows - static_cast<Index>(std::floor(setup.held_out * static_cast<double>(rows)));
    if (run.fit_end - run.skip < nuisance_ + parameters_ + 2) {
      throw Error(Fault::kData, "output",
                  sentence(12, "the run from row ", range.begin, " has ", rows, " rows, of which ",
                           std::max<Index>(0, run.fit_end - run.skip), " can be used: too few for ",
                           parameters_, " coefficients and ", nuisance_, " initial values"),
                  sentence(12, "row ", range.begin));
    }
    check_finite(inputs.middleRows(range.begin, rows), "inputs");
    check_finite(output.segment(range.begin, rows), "output");
    run.output = output.segment(range.begin, rows);
    total += variation(run.output.segment(run.skip, run.fit_end - run.skip));
    square += run.output.squaredNorm() / static_cast<double>(rows);
    fit_rows_ += run.fit_end - run.skip;
    for (Index i = 0; i < inputs.cols(); ++i) {
      const auto place = static_cast<std::size_t>(i);
      const Index d = delays_[place].samples;
      const auto u = inputs.col(i).segment(range.begin, rows);
      const double before = setup.rest ? 0.0 : u[0];
      const auto at = [&](Index k) { return k < 0 ? before : u[std::min(k, rows - 1)]; };
      Matrix taps(3, rows);
      for (Index k = 0; k < rows; ++k) {
        for (Index j = 0; j < 3; ++j) taps(j, k) = at(k - d - 1 + j);
      }
      const Eigen::Vector2d weights = value_weights(delays_[place].fraction, setup.hold);
      const bool feedthrough = setup.orders.zeros[place] == n_;
      run.direct.push_back(feedthrough ? Vector(taps.topRows(2).transpose() * weights) : Vector());
      run.taps.push_back(std::move(taps));
    }
    run.work = Matrix::Zero(n_ + parameters_, rows);
    run.basis = Matrix::Zero(states_, rows);
    run.error = Vector::Zero(rows);
    run.nuisance = Vector::Zero(nuisance_);
    if (setup.offset) {
      run.nuisance[states_] = run.output.segment(run.skip, run.fit_end - run.skip).mean();
    }
    runs_.push_back(std::move(run));
  }
  power_ = total / static_cast<double>(fit_rows_);
  for (Index i = 0; i < inputs.cols(); ++i) {
    double moved = 0.0;
    double size = 0.0;
    for (const RowRange& range : used) {
      const Vector u = inputs.col(i).segment(range.begin, range.end - range.begin);
      moved += variation(u);
      size += u.squaredNorm();
    }
    // A mean leaves 1e-16 of the square behind; a step from rest is an excitation all the same.
    if (moved > 1e-24 * size || (setup.rest && size > 0.0)) continue;
    throw Error(Fault::kAnalysis, "inputs",
                sentence(6, "input ", i, " is constant and tells nothing about the system"),
                sentence(6, "channel ", i));
  }
  if (!(power_ > 1e-24 * square)) {
    throw Error(Fault::kAnalysis, "output", "the output is constant and tells nothing");
  }
}

Index RationalProblem::nuisances() const { return nuisance_ * static_cast<Index>(runs_.size()); }

double RationalProblem::longest_s() const {
  Index longest = 0;
  for (const RationalRun& run : runs_) longest = std::max(longest, run.fit_end - run.skip);
  return static_cast<double>(longest) / rate_hz_;
}

// Scale -------------------------------------------------------------------------------------------

// With s = omega sigma, A = omega^n (sigma^n + ...): coefficient k of either polynomial is that of
// the scaled one times omega^(n-k).
Vector RationalProblem::units() const {
  Vector out(parameters_);
  for (Index i = 0; i < n_; ++i) out[i] = std::pow(omega_, static_cast<double>(n_ - i));
  Index next = n_;
  for (const Index m : setup_.orders.zeros) {
    for (Index j = 0; j <= m; ++j) out[next++] = std::pow(omega_, static_cast<double>(n_ - j));
  }
  return out;
}

void RationalProblem::set_scale(double omega) {
  const double next = std::isfinite(omega) && omega > 0.0 ? omega : 1.0;
  if (next != omega_) evaluated_.resize(0);
  omega_ = next;
}

Vector RationalProblem::to_scaled(const Vector& theta) const {
  return theta.cwiseQuotient(units());
}

Vector RationalProblem::from_scaled(const Vector& theta) const {
  return theta.cwiseProduct(units());
}

Rational RationalProblem::unpack(const Vector& theta) const {
  Rational model{theta.head(n_), {}};
  Index next = n_;
  for (const Index m : setup_.orders.zeros) {
    model.b.push_back(theta.segment(next, m + 1));
    next += m + 1;
  }
  return model;
}

// Simulation --------------------------------------------------------------------------------------

// Fills the filtered inputs, the free responses, and output less simulated output.
template <int N>
void RationalProblem::simulate(const Vector& a, const Vector& b, RationalRun& run) const {
  const int n = N == 0 ? static_cast<int>(n_) : N;
  const Matrix f = companion(a);
  const Vector last = Vector::Unit(n_, n_ - 1);
  const double step = omega_ / rate_hz_;
  const Index rows = run.rows();
  const State<N> coefficients = state_of<N>(a);
  run.error = run.output;
  Matrix transition;
  for (std::size_t i = 0; i < run.taps.size(); ++i) {
    const Step d = discretise(f, last, step, delays_[i].fraction, setup_.hold);
    transition = d.phi;
    const Square<N> phi = square_of<N>(d.phi);
    const State<N> gamma[3] = {state_of<N>(d.gamma.col(0)), state_of<N>(d.gamma.col(1)),
                               state_of<N>(d.gamma.col(2))};
    const bool single = d.gamma.col(0).isZero(0.0) && d.gamma.col(2).isZero(0.0);
    const int count = static_cast<int>(setup_.orders.zeros[i]) + 1;
    const bool feedthrough = count == n + 1;
    const double* weight = b.data() + (first_row_[i] - 2 * n_);
    const Matrix& taps = run.taps[i];
    State<N> s;
    for (Index k = 0; k < rows; ++k) {
      double* out = &run.work(first_row_[i], k);
      for (int j = 0; j < std::min(count, n); ++j) out[j] = s[j];
      if (feedthrough) out[n] = run.direct[i][k] - dot<N>(s, coefficients.v, n);
      double sum = 0.0;
      for (int j = 0; j < count; ++j) sum += weight[j] * out[j];
      run.error[k] -= sum;
      State<N> next;
      add_product<N>(phi, s, next, n);
      add<N>(taps(1, k), gamma[1], next, n);
      if (!single) {
        add<N>(taps(0, k), gamma[0], next, n);
        add<N>(taps(2, k), gamma[2], next, n);
      }
      s = next;
    }
  }
  if (states_ == 0) return;
  const Square<N> across = square_of<N>(transition.transpose());
  State<N> h;
  h[0] = 1.0;
  run.basis_end = rows;
  for (Index k = run.skip; k < rows; ++k) {
    double* out = &run.basis(0, k);
    for (int j = 0; j < n; ++j) out[j] = h[j];
    State<N> next;
    add_product<N>(across, h, next, n);
    h = next;
    if (dot<N>(h, h.v, n) < kGone) {
      run.basis_end = k + 1;
      break;
    }
  }
}

// Fills the filtered output; with `highest` its n-th derivative in the place of the error.
template <int N>
void RationalProblem::filter_output(const Vector& a, RationalRun& run, bool highest) const {
  const int n = N == 0 ? static_cast<int>(n_) : N;
  const Step held =
      discretise(companion(a), Vector::Unit(n_, n_ - 1), omega_ / rate_hz_, 0.0, Hold::kLinear);
  const Square<N> phi = square_of<N>(held.phi);
  const State<N> now = state_of<N>(held.gamma.col(1));
  const State<N> after = state_of<N>(held.gamma.col(2));
  const State<N> coefficients = state_of<N>(a);
  // Without its offset the output starts this filter with the least transient.
  const double offset = setup_.offset ? run.nuisance[states_] : 0.0;
  const Index rows = run.rows();
  State<N> s;
  for (Index k = 0; k < rows; ++k) {
    double* out = &run.work(n_, k);
    for (int j = 0; j < n; ++j) out[j] = -s[j];
    const double y = run.output[k] - offset;
    if (highest) run.error[k] = y - dot<N>(s, coefficients.v, n);
    State<N> next;
    add_product<N>(phi, s, next, n);
    add<N>(y, now, next, n);
    add<N>(run.output[std::min(k + 1, rows - 1)] - offset, after, next, n);
    s = next;
  }
}

// Fills the sensitivities to a and the filtered output.
template <int N>
void RationalProblem::differentiate(const Vector& theta, RationalRun& run) const {
  const int n = N == 0 ? static_cast<int>(n_) : N;
  const Rational model = unpack(theta);
  const Matrix f = companion(model.a);
  const double step = omega_ / rate_hz_;
  const Index rows = run.rows();
  run.work.topRows(n_).setZero();
  for (std::size_t i = 0; i < run.taps.size(); ++i) {
    Vector c = Vector::Zero(n_);
    const Vector& b = model.b[i];
    const Index count = std::min<Index>(b.size(), n_);
    for (Index j = 0; j < count; ++j) c[j] = b[j];
    Vector drive = Vector::Zero(2 * n_);
    drive[n_ - 1] = 1.0;
    if (b.size() > n_) {
      c -= b[n_] * model.a;
      drive[2 * n_ - 1] = b[n_];
    }
    const Step d = discretise(cascade(f, c), drive, step, delays_[i].fraction, setup_.hold);
    const Square<N> phi = square_of<N>(d.phi.topLeftCorner(n_, n_));
    const Square<N> cross = square_of<N>(d.phi.bottomLeftCorner(n_, n_));
    State<N> first[3], second[3];
    for (int t = 0; t < 3; ++t) {
      first[t] = state_of<N>(d.gamma.col(t).head(n_));
      second[t] = state_of<N>(d.gamma.col(t).tail(n_));
    }
    const bool single = d.gamma.col(0).isZero(0.0) && d.gamma.col(2).isZero(0.0);
    const Matrix& taps = run.taps[i];
    State<N> s, r;
    for (Index k = 0; k < rows; ++k) {
      double* out = &run.work(0, k);
      for (int j = 0; j < n; ++j) out[j] -= r[j];
      State<N> next, forward;
      add_product<N>(phi, r, next, n);
      add_product<N>(cross, s, next, n);
      add_product<N>(phi, s, forward, n);
      for (int t = single ? 1 : 0; t < (single ? 2 : 3); ++t) {
        add<N>(taps(t, k), second[t], next, n);
        add<N>(taps(t, k), first[t], forward, n);
      }
      r = next;
      s = forward;
    }
  }
  if (states_ > 0) {
    const Step free =
        discretise(cascade(f, Vector::Unit(n_, 0)), Vector::Zero(2 * n_), step, 0.0, Hold::kZero);
    const Square<N> phi = square_of<N>(free.phi.topLeftCorner(n_, n_));
    const Square<N> cross = square_of<N>(free.phi.bottomLeftCorner(n_, n_));
    State<N> z = state_of<N>(run.nuisance.head(n_));
    State<N> r;
    for (Index k = run.skip; k < rows; ++k) {
      double* out = &run.work(0, k);
      for (int j = 0; j < n; ++j) out[j] -= r[j];
      State<N> next, forward;
      add_product<N>(phi, r, next, n);
      add_product<N>(cross, z, next, n);
      add_product<N>(phi, z, forward, n);
      r = next;
      z = dot<N>(forward, forward.v, n) < kGone ? State<N>() : forward;
    }
  }
  filter_output<N>(model.a, run, false);
}

// Products of `rows` (any x rows of the run) with free responses and constant, over the rows in the
// sums.
Matrix RationalProblem::basis_products(const RationalRun& run, MatrixRef rows) const {
  Matrix out(rows.rows(), nuisance_);
  const Index end = std::min(run.basis_end, run.fit_end);
  if (states_ > 0) {
    out.leftCols(states_).noalias() = rows.middleCols(run.skip, end - run.skip) *
                                      run.basis.middleCols(run.skip, end - run.skip).transpose();
  }
  if (setup_.offset) {
    out.col(states_) = rows.middleCols(run.skip, run.fit_end - run.skip).rowwise().sum();
  }
  return out;
}

void RationalProblem::invert_basis(RationalRun& run) const {
  const Index end = std::min(run.basis_end, run.fit_end);
  Matrix gram = Matrix::Zero(nuisance_, nuisance_);
  if (states_ > 0)
    for_order(n_, [&]<int N>() {
      const int n = N == 0 ? static_cast<int>(n_) : N;
      Square<N> square;
      State<N> sum;
      for (Index k = run.skip; k < end; ++k) {
        State<N> h;
        for (int i = 0; i < n; ++i) h[i] = run.basis(i, k);
        for (int j = 0; j < n; ++j) add<N>(h[j], h, square.column[j], n);
        add<N>(1.0, h, sum, n);
      }
      for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i) gram(i, j) = square.column[j][i];
        if (setup_.offset) gram(n, j) = gram(j, n) = sum[j];
      }
    });
  if (setup_.offset) gram(states_, states_) = static_cast<double>(run.fit_end - run.skip);
  // What overflows on the way makes the sum of squares so too.
  run.inverse = gram.allFinite() ? gram_inverse(gram) : gram;
}

// Best states and offset for the errors at hand, taken out of them; the sum of squares that is
// left. The second pass removes what the squared condition of the first one leaves.
double RationalProblem::remove_nuisance(RationalRun& run) const {
  const Index count = run.fit_end - run.skip;
  run.nuisance.setZero();
  if (nuisance_ > 0) {
    invert_basis(run);
    const Index end = std::min(run.basis_end, run.fit_end);
    for (int pass = 0; pass < 2; ++pass) {
      Vector sums(nuisance_);
      if (setup_.offset) sums[states_] = run.error.segment(run.skip, count).sum();
      if (states_ > 0)
        for_order(n_, [&]<int N>() {
          const int n = N == 0 ? static_cast<int>(n_) : N;
          State<N> sum;
          for (Index k = run.skip; k < end; ++k) {
            const double e = run.error[k];
            const double* h = &run.basis(0, k);
            for (int i = 0; i < n; ++i) sum[i] += e * h[i];
          }
          for (int i = 0; i < n; ++i) sums[i] = sum[i];
        });
      const Vector change = run.inverse * sums;
      run.nuisance += change;
      if (setup_.offset) run.error.array() -= change[states_];
      if (states_ > 0)
        for_order(n_, [&]<int N>() {
          const int n = N == 0 ? static_cast<int>(n_) : N;
          const State<N> state = state_of<N>(change.head(states_));
          for (Index k = run.skip; k < run.basis_end; ++k) {
            run.error[k] -= dot<N>(state, &run.basis(0, k), n);
          }
        });
    }
  }
  return run.error.segment(run.skip, count).squaredNorm();
}

double RationalProblem::evaluate(const Vector& theta) {
  if (evaluated_.size() == theta.size() && evaluated_ == theta) return evaluated_sum_;
  evaluated_.resize(0);
  double sum = 0.0;
  for (RationalRun& run : runs_) {
    for_order(n_, [&]<int N>() { simulate<N>(theta.head(n_), theta.tail(parameters_ - n_), run); });
    sum += remove_nuisance(run);
    if (!std::isfinite(sum)) return NAN;
  }
  evaluated_ = theta;
  evaluated_sum_ = sum;
  return sum;
}

// Gram matrix of the work from row `first` on and the error, less what the basis explains.
Matrix RationalProblem::reduced_gram(const RationalRun& run, Index first) const {
  const Index count = run.fit_end - run.skip;
  const auto used = run.work.block(first, run.skip, run.work.rows() - first, count);
  const auto error = run.error.segment(run.skip, count);
  const Index width = used.rows();
  Matrix gram(width + 1, width + 1);
  gram.topLeftCorner(width, width).setZero();
  gram.topLeftCorner(width, width).selfadjointView<Eigen::Lower>().rankUpdate(used);
  gram.topLeftCorner(width, width).triangularView<Eigen::StrictlyUpper>() =
      gram.topLeftCorner(width, width).transpose();
  gram.col(width).head(width).noalias() = used * error;
  gram.row(width).head(width) = gram.col(width).head(width).transpose();
  gram(width, width) = error.squaredNorm();
  if (nuisance_ > 0) {
    Matrix cross(width + 1, nuisance_);
    cross << basis_products(run, run.work.bottomRows(width)),
        basis_products(run, run.error.transpose());
    gram.noalias() -= cross * run.inverse * cross.transpose();
  }
  return gram;
}

NormalEquations RationalProblem::normal_equations(const Vector& theta) {
  const Index p = parameters_;
  NormalEquations out{Matrix::Zero(p, p), Matrix::Zero(p, p), Vector::Zero(p)};
  std::vector<Index> z, f;
  for (Index i = 0; i < n_; ++i) {
    z.push_back(i);
    f.push_back(n_ + i);
  }
  for (Index i = 2 * n_; i < n_ + p; ++i) {
    z.push_back(i);
    f.push_back(i);
  }
  for (RationalRun& run : runs_) {
    for_order(n_, [&]<int N>() { differentiate<N>(theta, run); });
    const Matrix gram = reduced_gram(run, 0);
    out.zz += gram(z, z);
    out.zf += gram(z, f);
    out.g += gram(z, n_ + p);
  }
  return out;
}

Matrix RationalProblem::sensitivities(const RationalRun& run) const {
  const Index count = run.fit_end - run.skip;
  const auto used = run.work.middleCols(run.skip, count);
  Matrix out(parameters_, count);
  out << used.topRows(n_), used.bottomRows(parameters_ - n_);
  if (nuisance_ > 0) {
    Matrix all = Matrix::Zero(parameters_, run.rows());
    all.middleCols(run.skip, count) = out;
    const Matrix weights = basis_products(run, all) * run.inverse;
    const Index end = std::min(run.basis_end, run.fit_end) - run.skip;
    if (states_ > 0) {
      out.leftCols(end).noalias() -=
          weights.leftCols(states_) * run.basis.middleCols(run.skip, end);
    }
    if (setup_.offset) out.colwise() -= weights.col(states_);
  }
  return out;
}

Vector RationalProblem::filtered_least_squares(double omega, const std::vector<bool>& free,
                                               const Vector& fixed) {
  set_scale(omega);
  evaluated_.resize(0);
  const Index p = parameters_;
  const Vector filter = monic_polynomial(Eigen::VectorXcd::Constant(n_, -1.0));
  Matrix gram = Matrix::Zero(p, p);
  Vector right = Vector::Zero(p);
  for (RationalRun& run : runs_) {
    run.nuisance.setZero();
    if (setup_.offset) {
      run.nuisance[states_] = run.output.segment(run.skip, run.fit_end - run.skip).mean();
    }
    for_order(n_, [&]<int N>() {
      simulate<N>(filter, Vector::Zero(p - n_), run);
      filter_output<N>(filter, run, true);
    });
    if (nuisance_ > 0) invert_basis(run);
    const Matrix reduced = reduced_gram(run, n_);
    gram += reduced.topLeftCorner(p, p);
    right += reduced.col(p).head(p);
  }
  Vector theta = to_scaled(fixed);
  std::vector<Index> chosen;
  for (Index i = 0; i < p; ++i) {
    if (free[static_cast<std::size_t>(i)]) {
      chosen.push_back(i);
      theta[i] = 0.0;
    }
  }
  if (chosen.empty()) return theta;
  right -= gram * theta;
  const Matrix square = gram(chosen, chosen);
  const Vector scale =
      square.diagonal().unaryExpr([](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0; });
  const Eigen::ColPivHouseholderQR<Matrix> qr(scale.asDiagonal() * square * scale.asDiagonal());
  const Vector found =
      scale.asDiagonal() * qr.solve(Vector(scale.asDiagonal() * Vector(right(chosen))));
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    theta[chosen[i]] = found[static_cast<Index>(i)];
  }
  return theta;
}

}  // namespace ulna
