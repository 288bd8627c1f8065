#include "passivity/indices.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"
#include "passivity/port_function.hpp"

namespace ulna {
namespace {

std::string at_frequency(double omega) {
  if (std::isinf(omega)) return "at infinite frequency";
  return sentence(6, "at ", omega, " rad/s");
}

// The unit vector, or empty.
Vector checked_direction(const System& system, const IndexOptions& options) {
  require(system.outputs() == system.inputs(), "system",
          sentence(6, "passivity is defined for as many outputs as inputs; this system has ",
                   system.outputs(), " outputs and ", system.inputs(), " inputs"));
  require(options.tolerance >= 0.0 && options.tolerance <= 0.1, "tolerance",
          "the tolerance must lie between 0 and 0.1");
  if (options.band) {
    const Band& b = *options.band;
    require(b.low >= 0.0 && b.high > b.low && std::isfinite(b.low), "band",
            "the band must be two frequencies in rad/s, the first not negative and the second "
            "above it");
  }
  if (options.direction.size() == 0) return {};
  require(options.direction.size() == system.inputs(), "direction",
          sentence(6, "the direction has ", options.direction.size(), " components and the system ",
                   system.inputs(), " ports"));
  const double largest = options.direction.cwiseAbs().maxCoeff();
  require(std::isfinite(largest) && largest > 0.0 && options.direction.allFinite(), "direction",
          "the direction must hold finite numbers that are not all zero");
  return (options.direction / largest).normalized();
}

// The first flaw that makes the index infinite.
const PoleFlaw* ruin(const PortFunction& f, const IndexOptions& options) {
  for (const PoleFlaw& flaw : f.flaws()) {
    const bool counts = options.band
                            ? flaw.unbounded && flaw.on_axis && options.band->holds(flaw.omega)
                            : flaw.certain;
    if (counts) return &flaw;
  }
  return nullptr;
}

Extremum index_of(const PortFunction& f, const IndexOptions& options) {
  if (!f.exists()) return {kNaN, kNaN};
  if (const PoleFlaw* flaw = ruin(f, options)) return {-kInfinity, flaw->omega};
  LevelSetProblem problem;
  problem.value = [&](double omega) { return f.value(omega); };
  problem.crossings = [&](double level) { return f.crossings(level); };
  // A hundred times what rounding leaves of most values, far below what anybody reads off.
  problem.resolution = [&](double omega) {
    return 1e-11 * (std::abs(f.value(omega)) + f.size(omega));
  };
  Extremum found =
      smallest(problem, f.likely_frequencies(), options.band.value_or(Band{0.0, kInfinity}));
  // What is zero as far as double arithmetic can tell is reported as zero.
  if (std::abs(found.value) <= 1e-14 * f.size(found.omega)) found.value = 0.0;
  return found;
}

struct Margin {
  double value = kInfinity;
  double omega = 0.0;
};

Margin smallest_margin(const PortFunction& f, const Band& band, double worst_omega) {
  std::vector<double> omega = f.likely_frequencies();
  const std::vector<double> crossings = f.crossings(0.0);
  omega.insert(omega.end(), crossings.begin(), crossings.end());
  omega.push_back(worst_omega);
  Margin out;
  for (const double w : with_midpoints(std::move(omega), band)) {
    const double value = f.margin(w);
    if (value < out.value) out = {value, w};
  }
  return out;
}

std::string part_name(const PortFunction& f) {
  return f.ports() == 1 ? "the real part of the response"
                        : "the smallest eigenvalue of the Hermitian part of the response";
}

void decide(const PortFunction& f, const IndexOptions& options, PassivityIndices& out) {
  const std::string name = part_name(f);
  const std::string where = options.band ? " in the band" : "";
  if (const PoleFlaw* flaw = ruin(f, options)) {
    out.answer = Answer::kNotPassive;
    out.reason = "It has " + flaw->words + ".";
    return;
  }
  const Band band = options.band.value_or(Band{0.0, kInfinity});
  const Margin margin = smallest_margin(f, band, out.input.omega);
  const double limit = std::max(options.tolerance, kPortRounding);
  if (margin.value < -limit) {
    const bool same = f.margin(out.input.omega) < -limit;
    const double omega = same ? out.input.omega : margin.omega;
    out.answer = Answer::kNotPassive;
    out.reason =
        sentence(5, "At ", omega, " rad/s ", name, " is ", f.value(omega), ", below zero.");
    if (std::isinf(omega)) {
      out.reason = sentence(5, "At infinite frequency ", name, " is ", f.value(omega),
                            " or turns negative towards it.");
    }
    return;
  }
  for (const PoleFlaw& flaw : f.flaws()) {
    if (flaw.certain || (options.band && !options.band->holds(flaw.omega))) continue;
    out.answer = Answer::kUndecided;
    out.reason = "It has " + flaw.words + ", within the tolerance.";
    return;
  }
  if (margin.value <= limit) {
    out.answer = Answer::kUndecided;
    out.reason = sentence(5, "Relative to the response, ", name, " is ", margin.value, " ",
                          at_frequency(margin.omega), ": zero within the tolerance of ",
                          options.tolerance, ".");
    return;
  }
  out.answer = Answer::kPassive;
  if (std::isinf(margin.value)) {
    out.reason =
        "It is lossless: the Hermitian part of the response is zero at every frequency and "
        "every pole stores energy.";
    return;
  }
  const std::string poles = options.band ? "" : " and no pole is in the right half-plane";
  out.reason = sentence(5, "Nowhere", where, " is ", name, " negative (smallest: ", out.input.value,
                        " ", at_frequency(out.input.omega), ")", poles, ".");
}

void add_note(std::string& notes, const std::string& line) {
  notes += (notes.empty() ? "" : "\n") + line;
}

void explain(const PortFunction& f, const IndexOptions& options, const char* index,
             const char* whose, std::string& notes) {
  if (!f.exists()) {
    add_note(notes, std::string("There is no ") + index + " index, because " + whose +
                        " does not exist: the system is singular at every frequency.");
    return;
  }
  if (const PoleFlaw* flaw = ruin(f, options)) {
    add_note(notes, std::string("The ") + index + " index is infinite, because " + whose + " has " +
                        flaw->words + ".");
  }
}

void name_hidden(const PortFunction& f, std::string& notes) {
  for (const Complex p : f.hidden()) {
    add_note(notes, sentence(6, "A mode at ", p.real(),
                             p.imag() == 0.0 ? "" : sentence(6, " + ", p.imag(), "j"),
                             " rad/s cancels and does not show at the ports, but it is unstable."));
  }
}

}  // namespace

PassivityIndices passivity_indices(const System& system, const IndexOptions& options) {
  const Vector direction = checked_direction(system, options);
  PassivityIndices out;
  const PortFunction direct(system, PortView::kDirect, direction, options.tolerance);
  out.input = index_of(direct, options);
  decide(direct, options, out);
  name_hidden(direct, out.notes);
  const PortFunction inverted(system, PortView::kInverse, direction, options.tolerance);
  out.output = index_of(inverted, options);
  explain(inverted, options, "output", "the inverse", out.notes);
  const PortFunction scattered(system, PortView::kScattering, direction, options.tolerance);
  out.relative = index_of(scattered, options);
  out.relative.value = -out.relative.value;
  explain(scattered, options, "relative", "(I - H) (I + H)^-1", out.notes);
  return out;
}

Matrix index_curves(const System& system, const Vector& omega, const IndexOptions& options) {
  const Vector direction = checked_direction(system, options);
  require(omega.size() == 0 || (omega.minCoeff() >= 0.0 && !omega.hasNaN()), "omega",
          "frequencies must not be negative");
  Matrix out = Matrix::Constant(omega.size(), 3, kNaN);
  Index column = 0;
  for (const PortView view : {PortView::kDirect, PortView::kInverse, PortView::kScattering}) {
    const PortFunction f(system, view, direction, options.tolerance);
    const double sign = view == PortView::kScattering ? -1.0 : 1.0;
    for (Index i = 0; f.exists() && i < omega.size(); ++i) {
      out(i, column) = sign * f.value(omega(i));
    }
    ++column;
  }
  return out;
}

}  // namespace ulna
