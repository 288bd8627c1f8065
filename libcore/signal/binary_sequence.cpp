#include "signal/binary_sequence.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/random.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

void check(const BinarySpec& spec) {
  check_rate(spec.rate_hz);
  check_axes(spec.amplitude.size());
  if (spec.filtered) check_second_order(spec.filter);
  for (Index a = 0; a < spec.amplitude.size(); ++a) {
    require(std::isfinite(spec.amplitude[a]) && spec.amplitude[a] > 0.0, "amplitude",
            "the amplitude of axis " + std::to_string(a) + " must be a positive number");
  }
  require(std::isfinite(spec.clock_s) && spec.clock_s * spec.rate_hz >= 0.9999, "clock_s",
          "the sign must be held for at least one sample");
  require(std::isfinite(spec.return_s) && spec.return_s >= 0.0, "return_s",
          "the way back must take 0 s or longer");
  require(spec.duration_s > spec.return_s + spec.clock_s, "duration_s",
          "the duration must hold at least one sign and the way back");
}

// One axis: within each interval of the clock the input is constant, so the filter's state moves by
// its free response about that input.
void fill(const BinarySpec& spec, Index axis, Index used, Index clock, Excitation& out) {
  Random random(spec.seed, static_cast<std::uint64_t>(axis));
  SignalPoint at;  // state at the start of the interval
  SignalPoint now;
  const auto put = [&](Index row) {
    out.value(row, axis) = now.value;
    out.rate(row, axis) = now.rate;
    out.acceleration(row, axis) = now.acceleration;
  };
  for (Index begin = 0; begin < used; begin += clock) {
    const double input = random.below(2) == 0 ? -spec.amplitude[axis] : spec.amplitude[axis];
    const auto after = [&](Index rows) -> SignalPoint {
      if (!spec.filtered) return {input, 0.0, 0.0};
      SignalPoint p = free_response(spec.filter, at.value - input, at.rate,
                                    static_cast<double>(rows) / spec.rate_hz);
      p.value += input;
      return p;
    };
    const Index count = std::min(clock, used - begin);
    for (Index i = 0; i < count; ++i) {
      now = after(i);
      put(begin + i);
    }
    at = now = after(count);
  }
  for (Index row = used; row < out.rows(); ++row) {
    const double t = static_cast<double>(row - used) / spec.rate_hz;
    now = gently_back(at, spec.return_s, std::min(t, spec.return_s));
    put(row);
  }
}

}  // namespace

Excitation random_binary(const BinarySpec& spec, Token* token) {
  check(spec);
  const Index n = spec.amplitude.size();
  const Index rows = rows_of(spec.duration_s, spec.rate_hz, "duration_s");
  const Index used = rows - static_cast<Index>(std::llround(spec.return_s * spec.rate_hz));
  const Index clock = std::max<Index>(1, std::llround(spec.clock_s * spec.rate_hz));
  require(used >= 2, "duration_s", "the duration must hold more than the way back");
  Excitation out;
  out.drive = spec.drive;
  out.rate_hz = spec.rate_hz;
  out.segments = {{0, used}};
  out.value = out.rate = out.acceleration = Matrix::Zero(rows, n);
  for (Index a = 0; a < n; ++a) {
    step(token, static_cast<double>(a) / static_cast<double>(n));
    fill(spec, a, used, clock, out);
  }
  if (spec.filtered) {
    const StepFacts facts = step_facts(spec.filter);
    if (facts.settling_s > spec.clock_s) {
      out.notes.push_back(sentence(
          3, "The filter settles to 2 % in ", facts.settling_s, " s and the sign is drawn every ",
          spec.clock_s,
          " s: swings add up, so the peak may exceed that of a single step; see the peak."));
    }
  } else {
    out.notes.push_back(
        "Without a filter the reference jumps: its rate is given as 0 and does not hold the "
        "jumps.");
  }
  if (spec.return_s == 0.0) {
    out.notes.push_back("The design ends in motion: give it a way back.");
  }
  out.provenance =
      sentence(9, "design: random binary sequence on ", n, n == 1 ? " axis" : " axes",
               ", a sign every ", spec.clock_s, " s, ",
               spec.filtered ? sentence(9, "through zeta ", spec.filter.damping_ratio, ", ",
                                        spec.filter.natural_rad_s, " rad/s, ")
                             : std::string("without a filter, "),
               "seed ", spec.seed, ", ", spec.duration_s, " s at ", spec.rate_hz, " Hz");
  return out;
}

}  // namespace ulna
