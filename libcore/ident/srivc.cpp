#include "ident/srivc.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <memory>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

// A step that moves the output by less than this share of it is rounding.
constexpr double kStepRounding = 1e-12;

constexpr double kLittle = 50.0;  // percent explained, below which a note says so

// Sensitivities of unit length that are closer to dependent than this determine nothing.
constexpr double kWorstCondition = 1e7;

constexpr Index kMostNoiseOrder = 30;

struct Limits {
  Vector lower, upper;  // in the problem's scale

  bool fixed(Index i) const { return lower[i] == upper[i]; }
  bool any(Index first, Index count) const {
    for (Index i = first; i < first + count; ++i) {
      if (std::isfinite(lower[i]) || std::isfinite(upper[i])) return true;
    }
    return false;
  }
  Vector clip(const Vector& theta) const { return theta.cwiseMax(lower).cwiseMin(upper); }
};

Limits given_limits(const RationalOptions& options, Index count) {
  Limits limits{Vector::Constant(count, -kInfinity), Vector::Constant(count, kInfinity)};
  const auto take = [count](const Vector& given, Vector& out, const char* name) {
    if (given.size() == 0) return;
    require(given.size() == count, name,
            sentence(6, name, " has ", given.size(), " entries for ", count, " coefficients"));
    require(!given.hasNaN(), name, sentence(6, name, " holds a value that is not a number"));
    out = given;
  };
  take(options.lower, limits.lower, "lower");
  take(options.upper, limits.upper, "upper");
  for (Index i = 0; i < count; ++i) {
    const bool possible = limits.lower[i] <= limits.upper[i] && limits.lower[i] < kInfinity &&
                          limits.upper[i] > -kInfinity;
    require(possible, "bounds",
            sentence(6, "the bounds of ", coefficient_name(options.setup.orders, i),
                     " exclude every value: lower ", limits.lower[i], ", upper ", limits.upper[i]));
  }
  return limits;
}

struct Solution {
  Vector theta;  // physical
  double sse = kInfinity;
  bool converged = false;
  bool reflected = false;  // the last step was for a pole in the right half plane
  int iterations = 0;
};

class Search {
 public:
  Search(RationalProblem& problem, const RationalOptions& options, Token* token)
      : problem_(problem),
        options_(options),
        token_(token),
        physical_(given_limits(options, problem.parameters())),
        n_(problem.setup().orders.poles) {
    free_.resize(static_cast<std::size_t>(problem.parameters()));
    for (Index i = 0; i < problem.parameters(); ++i) {
      free_[static_cast<std::size_t>(i)] = !physical_.fixed(i);
    }
  }

  bool nothing_free() const {
    return std::none_of(free_.begin(), free_.end(), [](bool b) { return b; });
  }
  const Limits& limits() const { return physical_; }

  // Best stable models that state-variable filters of several cut-offs lead to, best first.
  std::vector<Solution> starts();

  Solution iterate(Solution start);

 private:
  void set_scale(double omega) {
    problem_.set_scale(omega);
    limits_ = {problem_.to_scaled(physical_.lower), problem_.to_scaled(physical_.upper)};
  }
  std::vector<double> cutoffs() const;
  bool admit(Vector& theta, bool& reflected) const;
  double sum_of(const Vector& theta) {
    const double sse = problem_.evaluate(theta);
    return std::isfinite(sse) ? sse : kInfinity;
  }
  std::vector<Index> movable(const Vector& theta, const Vector& g) const;
  Vector direction(const NormalEquations& eq, const Matrix& matrix,
                   const std::vector<Index>& chosen) const;

  RationalProblem& problem_;
  const RationalOptions& options_;
  Token* token_;
  Limits physical_;
  Limits limits_;
  Index n_;
  std::vector<bool> free_;
};

// From two periods in the longest run to half of the Nyquist frequency, a factor of about 5 apart:
// a start within a factor of 3 of the system's band is enough for the iterations.
std::vector<double> Search::cutoffs() const {
  std::vector<double> out;
  for (const double hz : options_.cutoffs_hz) {
    require(std::isfinite(hz) && hz > 0.0, "cutoffs_hz", "cutoffs_hz must be positive");
    out.push_back(2.0 * kPi * hz);
  }
  if (!out.empty()) return out;
  const double high = 0.5 * kPi * problem_.rate_hz();
  const double low = std::min(4.0 * kPi / problem_.longest_s(), high / 16.0);
  const int count =
      std::clamp(static_cast<int>(std::lround(std::log(high / low) / std::log(5.0))) + 1, 3, 9);
  for (int i = 0; i < count; ++i) {
    out.push_back(low * std::pow(high / low, static_cast<double>(i) / (count - 1)));
  }
  return out;
}

// Makes a candidate stable and keeps it within the bounds; false when that is not possible.
bool Search::admit(Vector& theta, bool& reflected) const {
  theta = limits_.clip(theta);
  Vector a = theta.head(n_);
  if (!a.allFinite()) return false;
  if (!reflect_poles(a)) return true;
  reflected = true;
  if (limits_.any(0, n_)) return false;  // the mirror image need not keep the bounds
  theta.head(n_) = a;
  return true;
}

std::vector<Solution> Search::starts() {
  const Index p = problem_.parameters();
  Vector fixed = Vector::Zero(p);
  for (Index i = 0; i < p; ++i) {
    if (physical_.fixed(i)) fixed[i] = physical_.lower[i];
  }
  std::vector<Solution> found;
  for (const double omega : cutoffs()) {
    step(token_, 0.0);
    Vector theta = problem_.filtered_least_squares(omega, free_, fixed);
    set_scale(omega);
    bool reflected = false;
    if (!theta.allFinite()) continue;
    if (!admit(theta, reflected)) {
      // Bounds on the denominator hold one pole or more in the right half plane: the filter itself
      // is the nearest stable thing there is.
      const Vector filter = monic_polynomial(Eigen::VectorXcd::Constant(n_, -1.0));
      for (Index i = 0; i < n_; ++i) {
        if (free_[static_cast<std::size_t>(i)]) theta[i] = filter[i];
      }
      if (!admit(theta, reflected)) continue;
    }
    Solution start;
    start.sse = sum_of(theta);
    start.theta = problem_.from_scaled(theta);
    if (std::isfinite(start.sse)) found.push_back(start);
  }
  std::sort(found.begin(), found.end(),
            [](const Solution& x, const Solution& y) { return x.sse < y.sse; });
  return found;
}

// Coefficients that a step may move: free, and not held by a bound that the slope pushes against.
std::vector<Index> Search::movable(const Vector& theta, const Vector& g) const {
  std::vector<Index> out;
  for (Index i = 0; i < theta.size(); ++i) {
    if (!free_[static_cast<std::size_t>(i)]) continue;
    if (theta[i] <= limits_.lower[i] && g[i] < 0.0) continue;
    if (theta[i] >= limits_.upper[i] && g[i] > 0.0) continue;
    out.push_back(i);
  }
  return out;
}

Vector Search::direction(const NormalEquations& eq, const Matrix& matrix,
                         const std::vector<Index>& chosen) const {
  Vector out = Vector::Zero(eq.g.size());
  if (chosen.empty()) return out;
  const Vector scale = Vector(eq.zz.diagonal()(chosen)).unaryExpr([](double d) {
    return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0;
  });
  const Matrix scaled = scale.asDiagonal() * Matrix(matrix(chosen, chosen)) * scale.asDiagonal();
  const Eigen::ColPivHouseholderQR<Matrix> qr(scaled);
  const Vector found =
      scale.asDiagonal() * qr.solve(Vector(scale.asDiagonal() * Vector(eq.g(chosen))));
  for (std::size_t i = 0; i < chosen.size(); ++i) out[chosen[i]] = found[static_cast<Index>(i)];
  return out;
}

Solution Search::iterate(Solution current) {
  // Powers of the poles stay near 1 in units of their mean frequency.
  set_scale(mean_frequency(current.theta.head(n_)));
  Vector theta = limits_.clip(problem_.to_scaled(current.theta));
  double sse = sum_of(theta);
  const double rows = static_cast<double>(problem_.fit_rows());
  const double total = rows * problem_.output_power();
  double damping = 1e-3;
  for (int i = 0; i < options_.max_iterations && !current.converged; ++i) {
    step(token_, static_cast<double>(i) / options_.max_iterations);
    const NormalEquations eq = problem_.normal_equations(theta);
    ++current.iterations;
    if (!eq.zz.allFinite() || !eq.zf.allFinite()) break;
    const std::vector<Index> chosen = movable(theta, eq.g);
    if (chosen.empty()) {
      current.converged = true;
      break;
    }
    Vector next;
    double reached = kInfinity;
    bool whole = false;  // the step was taken as it came
    const auto attempt = [&](const Vector& change) {
      Vector candidate = theta + change;
      bool reflected = false;
      if (!admit(candidate, reflected)) {
        current.reflected = current.reflected || reflected;
        return false;
      }
      const double found = sum_of(candidate);
      // Rounding of the sum must not turn the last step away.
      if (!(found <= sse * (1.0 + 1e-10) + 1e-30 * total)) return false;
      next = candidate;
      reached = found;
      current.reflected = reflected;
      return true;
    };
    if (options_.method == FitMethod::kInstrumental) {
      const Vector change = direction(eq, eq.zf, chosen);
      for (double share = 1.0; share > 0.2 && !std::isfinite(reached); share /= 2.0) {
        if (attempt(share * change)) whole = share == 1.0;
      }
    }
    // The baseline, and what replaces a refined step that leads nowhere.
    while (!std::isfinite(reached) && damping < 1e12) {
      Matrix matrix = eq.zz;
      matrix.diagonal() *= 1.0 + damping;
      if (attempt(direction(eq, matrix, chosen))) {
        whole = damping < 0.1;
        damping = std::max(damping / 10.0, 1e-15);
      } else {
        damping *= 10.0;
      }
    }
    if (!std::isfinite(reached)) {
      // No direction helps: either nothing is left to gain, or the model ends here.
      const double gain = eq.g.dot(direction(eq, eq.zz, chosen));
      current.converged = gain <= 1e-8 * sse + kStepRounding * kStepRounding * total;
      sse = sum_of(theta);
      break;
    }
    const Vector change = next - theta;
    const double moved = change.dot(eq.zz * change);
    const double variance = reached / std::max(1.0, rows - static_cast<double>(theta.size()));
    const double least =
        options_.tolerance * options_.tolerance * variance * static_cast<double>(chosen.size());
    current.converged = whole && !current.reflected &&
                        moved <= std::max(least, kStepRounding * kStepRounding * total);
    theta = next;
    sse = reached;
  }
  current.theta = problem_.from_scaled(theta);
  // What is fixed or at a bound comes back to the last bit.
  for (Index i = 0; i < theta.size(); ++i) {
    if (theta[i] == limits_.lower[i]) current.theta[i] = physical_.lower[i];
    if (theta[i] == limits_.upper[i]) current.theta[i] = physical_.upper[i];
  }
  current.sse = sse;
  return current;
}

Solution solve(RationalProblem& problem, const RationalOptions& options, const Vector* start,
               Token* token) {
  Search search(problem, options, token);
  if (search.nothing_free()) {
    Solution given;
    given.theta = search.limits().lower;
    given.converged = true;
    problem.set_scale(mean_frequency(given.theta.head(problem.setup().orders.poles)));
    given.sse = problem.evaluate(problem.to_scaled(given.theta));
    if (std::isfinite(given.sse)) return given;
    throw Error(Fault::kAnalysis, "fixed",
                "the given model grows beyond every bound on these data");
  }
  std::vector<Solution> starts;
  if (start != nullptr) {
    starts.push_back({});
    starts.front().theta = *start;
  } else {
    starts = search.starts();
  }
  if (starts.empty()) {
    throw Error(Fault::kAnalysis, "bounds",
                "no stable model within the bounds can be simulated on these data: widen them, or "
                "ask for fewer poles");
  }
  Solution best;
  // Usually the first start is enough; another may reach what the first one could not.
  for (std::size_t i = 0; i < std::min<std::size_t>(starts.size(), 4); ++i) {
    Solution found = search.iterate(starts[i]);
    if (i == 0 || (found.converged && !best.converged) ||
        (found.converged == best.converged && found.sse < best.sse)) {
      best = std::move(found);
    }
    if (best.converged) break;
  }
  problem.set_scale(mean_frequency(best.theta.head(problem.setup().orders.poles)));
  problem.evaluate(problem.to_scaled(best.theta));
  return best;
}

// Sums for a variance accounted for, each run about its mean.
struct Shares {
  double error = 0.0;
  double output = 0.0;

  void add(const Vector& e, const Vector& y) {
    if (y.size() < 2) return;
    error += (e.array() - e.mean()).square().sum();
    output += (y.array() - y.mean()).square().sum();
  }
  double vaf() const { return output > 0.0 ? 100.0 * (1.0 - error / output) : kNaN; }
};

// Statistics
// ---------------------------------------------------------------------------------------

void describe_fit(RationalProblem& problem, const RationalOptions& options, RationalFit& fit) {
  Shares shares;
  std::vector<Vector> errors;
  for (const RationalRun& run : problem.runs()) {
    const Index count = run.fit_end - run.skip;
    const Vector error = run.error.segment(run.skip, count);
    shares.add(error, run.output.segment(run.skip, count));
    errors.push_back(error);
  }
  fit.vaf = shares.vaf();
  fit.rows = problem.fit_rows();

  const Limits limits = given_limits(options, problem.parameters());
  const Vector theta = problem.to_scaled(fit.theta);
  const NormalEquations eq = problem.normal_equations(theta);
  std::vector<Index> chosen;
  fit.state.assign(static_cast<std::size_t>(fit.theta.size()), 0);
  for (Index i = 0; i < fit.theta.size(); ++i) {
    const double value = fit.theta[i];
    const double near = 1e-9 * std::abs(value);
    const bool held = (value <= limits.lower[i] + near && eq.g[i] < 0.0) ||
                      (value >= limits.upper[i] - near && eq.g[i] > 0.0);
    fit.state[static_cast<std::size_t>(i)] = limits.fixed(i) ? 1 : held ? 2 : 0;
    if (fit.state[static_cast<std::size_t>(i)] == 0) chosen.push_back(i);
  }
  const double n = static_cast<double>(fit.rows);
  const double k = static_cast<double>(static_cast<Index>(chosen.size()) + problem.nuisances());
  fit.noise_variance = fit.sse / std::max(1.0, n - k);
  fit.noise = residual_noise(errors, options.white ? 0 : kMostNoiseOrder);
  // Residuals have lost the degrees of freedom that the coefficients took.
  fit.noise.innovation *= fit.noise_variance / std::max(fit.noise.variance, 1e-300);
  fit.noise.variance = fit.noise_variance;

  // The noise variance counts as a parameter.
  fit.aic = n * std::log(fit.sse / n) + 2.0 * (k + 1.0);
  fit.aicc = fit.aic + 2.0 * (k + 1.0) * (k + 2.0) / std::max(1.0, n - k - 2.0);
  fit.bic = n * std::log(fit.sse / n) + (k + 1.0) * std::log(n);

  fit.covariance = Matrix::Zero(fit.theta.size(), fit.theta.size());
  fit.condition = 1.0;
  fit.yic = std::log(fit.noise_variance / problem.output_power());
  if (chosen.empty()) return;
  const Matrix information = eq.zz(chosen, chosen);
  const Vector scale =
      information.diagonal().unaryExpr([](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 0.0; });
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(scale.asDiagonal() * information *
                                                     scale.asDiagonal());
  const double least = solver.eigenvalues()[0];
  fit.condition = least > 0.0 && scale.minCoeff() > 0.0
                      ? std::sqrt(solver.eigenvalues().maxCoeff() / least)
                      : kInfinity;
  if (!(fit.condition < 1e8)) {  // the square of the condition is lost in rounding
    fit.condition = kInfinity;
    for (const Index i : chosen) fit.covariance(i, i) = kInfinity;
    fit.yic = kInfinity;
    return;
  }
  const Matrix v = scale.asDiagonal() * solver.eigenvectors();
  const Matrix inverse = v * solver.eigenvalues().cwiseInverse().asDiagonal() * v.transpose();
  Matrix covariance = fit.noise_variance * inverse;
  const Vector values = theta(chosen);
  fit.yic += std::log((covariance.diagonal().array() / values.array().square()).mean());
  if (fit.noise.ar.size() > 0) {
    Matrix score = Matrix::Zero(covariance.rows(), covariance.cols());
    for (const RationalRun& run : problem.runs()) {
      score += score_covariance(problem.sensitivities(run)(chosen, Eigen::all), fit.noise);
    }
    covariance = inverse * score * inverse;
  }
  const Vector units = problem.units()(chosen);
  covariance = units.asDiagonal() * covariance * units.asDiagonal();
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    for (std::size_t j = 0; j < chosen.size(); ++j) {
      fit.covariance(chosen[i], chosen[j]) =
          covariance(static_cast<Index>(i), static_cast<Index>(j));
    }
  }
}

// Simulated output and errors on the rows of the record, and initial values in physical units.
void write_series(const RationalProblem& problem, Index rows, RationalFit& fit) {
  const Index n = fit.setup.orders.poles;
  fit.simulated = Vector::Constant(rows, kNaN);
  fit.output_error = Vector::Constant(rows, kNaN);
  fit.nuisance = Matrix::Zero(static_cast<Index>(problem.runs().size()), n + 1);
  Index r = 0;
  for (const RationalRun& run : problem.runs()) {
    const Index count = run.rows() - run.skip;
    const Vector error = run.error.tail(count);
    fit.output_error.segment(run.begin + run.skip, count) = error;
    fit.simulated.segment(run.begin + run.skip, count) = run.output.tail(count) - error;
    if (!fit.setup.rest) {
      for (Index i = 0; i < n; ++i) {
        fit.nuisance(r, i) = run.nuisance[i] * std::pow(problem.scale(), static_cast<double>(i));
      }
    }
    if (fit.setup.offset) fit.nuisance(r, n) = run.nuisance[fit.setup.rest ? 0 : n];
    ++r;
  }
}

void write_validation(const RationalProblem& problem, Index rows, RationalFit& fit) {
  fit.validation_error = Vector::Constant(rows, kNaN);
  Shares shares;
  fit.held_out_rows = 0;
  for (const RationalRun& run : problem.runs()) {
    const Index count = run.rows() - run.fit_end;
    if (count == 0) continue;
    const Vector error = run.error.tail(count);
    fit.validation_error.segment(run.begin + run.fit_end, count) = error;
    shares.add(error, run.output.tail(count));
    fit.held_out_rows += count;
  }
  fit.vaf_held_out = shares.vaf();
}

// Words
// --------------------------------------------------------------------------------------------

void judge(const RationalProblem& problem, const Solution& solution, RationalFit& fit) {
  const auto bad = [&fit](FitOutcome outcome, const std::string& why) {
    if (fit.outcome == FitOutcome::kGood) fit.outcome = outcome;
    fit.notes.push_back(why);
  };
  const double n = static_cast<double>(fit.rows);
  if (!solution.converged && solution.reflected) {
    bad(FitOutcome::kUnstable,
        "the data ask for a pole in the right half plane, and this is the best stable model: the "
        "output may drift, the sign of a signal may be wrong, or the data come from a closed loop");
  } else if (!solution.converged) {
    bad(FitOutcome::kNotConverged,
        sentence(6, "the estimate still moved after ", solution.iterations,
                 " iterations: fewer poles or zeros, another delay or bounds may help"));
  }
  if (!(fit.condition < kWorstCondition)) {
    bad(FitOutcome::kIllConditioned,
        "the data do not determine all coefficients: ask for fewer poles or zeros, or excite more "
        "frequencies");
  }
  // Noise alone is explained by about a coefficient's share each, and by the best of all the
  // frequencies that a pole may choose from.
  const double chance = 100.0 * 4.0 * (static_cast<double>(fit.theta.size()) + std::log(n)) / n;
  if (fit.vaf < chance || fit.vaf_held_out < 0.0) {
    bad(FitOutcome::kUnexplained,
        sentence(3, "the model explains ", std::max(0.0, fit.vaf), " % of the output",
                 fit.vaf_held_out < 0.0 ? ", and none of the held-out rows" : "",
                 ": input and output may be unrelated, or the delay wrong"));
  }
  if (fit.outcome == FitOutcome::kGood && fit.vaf < kLittle) {
    fit.notes.push_back(sentence(
        3, "the model explains only ", fit.vaf,
        " % of the output: the rest is noise, or the orders or the delay (in seconds) are wrong"));
  }
  std::vector<std::string> held;
  for (Index i = 0; i < fit.theta.size(); ++i) {
    if (fit.state[static_cast<std::size_t>(i)] == 2) {
      held.push_back(coefficient_name(fit.setup.orders, i));
    }
  }
  if (!held.empty()) {
    fit.notes.push_back(sentence(6, "at a bound, and without a standard error: ", join(held)));
  }
  if (fit.noise.ar.size() > 0 && fit.vaf < 100.0 - 1e-9) {  // else they are rounding
    fit.notes.push_back(
        sentence(6, "the output errors are correlated in time (autoregression of order ",
                 fit.noise.ar.size(), "): the standard errors allow for it"));
  }
  const Eigen::VectorXcd poles = model_poles(fit.model);
  for (const auto& pole : poles) {
    if (std::abs(pole) > kPi * problem.rate_hz()) {
      fit.notes.push_back(sentence(3, "a pole at ", std::abs(pole),
                                   " rad/s is faster than the samples can show: one pole less may "
                                   "do"));
      break;
    }
  }
  for (std::size_t i = 0; i < fit.model.b.size(); ++i) {
    for (const auto& zero : polynomial_roots(fit.model.b[i])) {
      for (const auto& pole : poles) {
        if (zero.imag() < 0.0 || std::abs(pole - zero) > 0.02 * std::abs(pole)) continue;
        fit.notes.push_back(sentence(3, "a pole and a zero near ", std::abs(pole),
                                     " rad/s all but cancel: one of each less may do"));
      }
    }
  }
}

}  // namespace

std::string coefficient_name(const RationalOrders& orders, Index coefficient) {
  if (coefficient < orders.poles) return sentence(6, "a", coefficient);
  coefficient -= orders.poles;
  for (std::size_t i = 0; i < orders.zeros.size(); ++i) {
    if (coefficient <= orders.zeros[i]) {
      if (orders.zeros.size() == 1) return sentence(6, "b", coefficient);
      return sentence(6, "b", coefficient, "[", i, "]");
    }
    coefficient -= orders.zeros[i] + 1;
  }
  return "";
}

RationalFit identify_rational(MatrixRef inputs, VectorRef output, double rate_hz,
                              const std::vector<RowRange>& ranges, const RationalOptions& options,
                              Token* token) {
  require(options.max_iterations >= 1, "max_iterations", "max_iterations must be at least 1");
  require(options.tolerance > 0.0, "tolerance", "tolerance must be positive");
  RationalFit fit;
  fit.setup = options.setup;
  fit.rate_hz = rate_hz;
  fit.method = options.method;
  fit.vaf_held_out = kNaN;

  auto problem = std::make_unique<RationalProblem>(inputs, output, rate_hz, ranges, options.setup);
  Solution solution = solve(*problem, options, nullptr, token);
  write_validation(*problem, output.size(), fit);
  if (fit.held_out_rows > 0 && options.refit) {
    RationalSetup whole = options.setup;
    whole.held_out = 0.0;
    problem = std::make_unique<RationalProblem>(inputs, output, rate_hz, ranges, whole);
    solution = solve(*problem, options, &solution.theta, token);
    if (!solution.converged) solution = solve(*problem, options, nullptr, token);
    fit.refitted = true;
  }
  fit.theta = solution.theta;
  fit.model = problem->unpack(fit.theta);
  fit.iterations = solution.iterations;
  fit.sse = solution.sse;
  describe_fit(*problem, options, fit);
  write_series(*problem, output.size(), fit);
  judge(*problem, solution, fit);
  return fit;
}

}  // namespace ulna
