#include "signal/multisine.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numeric>

#include "base/error.hpp"
#include "base/random.hpp"
#include "base/words.hpp"
#include "signal/crest.hpp"

namespace ulna {
namespace {

using Complex = std::complex<double>;

// A frequency counts as a multiple of 1 / T when it misses one by less than this share of a cycle.
constexpr double kWholeCycles = 1e-6;
constexpr Index kMostLines = 1000;
// Share of the band that evenly spaced lines must reach.
constexpr double kReachOfBand = 0.9;

void check(const MultisineSpec& spec) {
  check_rate(spec.rate_hz);
  check_axes(spec.amplitude.size());
  for (Index a = 0; a < spec.amplitude.size(); ++a) {
    require(std::isfinite(spec.amplitude[a]) && spec.amplitude[a] > 0.0, "amplitude",
            "the amplitude of axis " + std::to_string(a) + " must be a positive number");
  }
  require(std::isfinite(spec.fade_s) && spec.fade_s >= 0.0, "fade_s",
          "the fade must last 0 s or longer");
  require(spec.duration_s > 2.0 * spec.fade_s, "fade_s",
          "two fades must leave a part of the duration");
  require(std::isfinite(spec.slope) && std::abs(spec.slope) <= 4.0, "slope",
          "the slope of the spectrum must be from -4 to 4");
  require(spec.starts >= 0 && spec.starts <= 1000, "starts",
          "the optimisation takes from 0 to 1000 random starts");
  if (spec.lines_hz.size() > 0) {
    require(spec.lines_hz.rows() <= kMostLines, "lines_hz", "an axis has at most 1000 lines");
    require(spec.lines_hz.cols() == 1 || spec.lines_hz.cols() == spec.amplitude.size(), "lines_hz",
            "lines_hz must have one column, or one for every axis");
    for (Index i = 0; i < spec.lines_hz.size(); ++i) {
      const double f = spec.lines_hz.reshaped()[i];
      require(
          std::isfinite(f) && f > 0.0 && f < 0.5 * spec.rate_hz, "lines_hz",
          sentence(6, "a line at ", f, " Hz: lines lie above 0 and below half the sampling rate, ",
                   0.5 * spec.rate_hz, " Hz"));
    }
    return;
  }
  require(spec.lines >= 1 && spec.lines <= kMostLines, "lines", "an axis has from 1 to 1000 lines");
  require(std::isfinite(spec.low_hz) && spec.low_hz >= 0.0, "low_hz",
          "the band must begin at 0 Hz or above");
  require(std::isfinite(spec.high_hz) && spec.high_hz > spec.low_hz, "high_hz",
          "the band must end above where it begins");
  require(
      spec.high_hz < 0.5 * spec.rate_hz, "high_hz",
      sentence(6, "the band must end below half the sampling rate, ", 0.5 * spec.rate_hz, " Hz"));
}

// lines x axes, Hz.
Matrix frequencies(const MultisineSpec& spec, double period_s) {
  const Index n = spec.amplitude.size();
  if (spec.lines_hz.size() > 0) {
    Matrix out(spec.lines_hz.rows(), n);
    for (Index a = 0; a < n; ++a) out.col(a) = spec.lines_hz.col(spec.lines_hz.cols() == 1 ? 0 : a);
    for (Index a = 0; a < n; ++a) {
      Vector sorted = out.col(a);
      std::sort(sorted.begin(), sorted.end());
      require(std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end(), "lines_hz",
              "axis " + std::to_string(a) + " holds a line twice");
      out.col(a) = sorted;
    }
    return out;
  }
  // Evenly along the band; axes take turns unless they share.
  const Index turns = spec.shared ? 1 : n;
  const double count = static_cast<double>(spec.lines * turns);
  double spacing = (spec.high_hz - spec.low_hz) / count * period_s;  // in steps of the grid
  require(
      spacing >= 1.0 - 1e-9, "lines",
      sentence(6, spec.lines, " lines for ", turns, turns == 1 ? " axis" : " axes", " need ", count,
               " multiples of 1 / period, and the band from ", spec.low_hz, " to ", spec.high_hz,
               " Hz holds ", std::floor((spec.high_hz - spec.low_hz) * period_s + 1e-9), " of ",
               1.0 / period_s, " Hz: lengthen the period, widen the band or take fewer lines"));
  // A whole number of steps apart, lines from 0 Hz on are harmonics of one frequency, and their sum
  // repeats soon: its crest factor can be brought to 1.4, where lines beside the harmonics move
  // through all phases and stay above 1.6. Where that would leave too much of the band empty, lines
  // are rounded down one by one; they stay distinct, being at least one step apart.
  const double whole = std::floor(spacing + 1e-9);
  if (whole >= kReachOfBand * spacing) spacing = whole;
  Matrix out(spec.lines, n);
  for (Index l = 0; l < spec.lines; ++l) {
    for (Index a = 0; a < n; ++a) {
      const double place = static_cast<double>(l * turns + (spec.shared ? 0 : a) + 1);
      out(l, a) = std::floor(spec.low_hz * period_s + spacing * place + 1e-6) / period_s;
    }
  }
  return out;
}

// When the sum of lines repeats: a span of whole cycles over the largest divisor that their numbers
// have in common; otherwise the span itself.
double repeats_after(const Vector& freq, double span_s) {
  std::int64_t common = 0;
  for (const double f : freq) {
    const double cycles = f * span_s;
    if (std::abs(cycles - std::round(cycles)) > kWholeCycles * std::max(1.0, cycles)) return span_s;
    common = std::gcd(common, std::llround(cycles));
  }
  return span_s / static_cast<double>(std::max<std::int64_t>(1, common));
}

// The same lines with what was at `time_s` at 0.
Sinusoids begun_at(Sinusoids lines, double time_s) {
  for (Index k = 0; k < lines.freq_hz.size(); ++k) {
    lines.phase_rad[k] =
        std::remainder(lines.phase_rad[k] + 2.0 * kPi * lines.freq_hz[k] * time_s, 2.0 * kPi);
  }
  return lines;
}

struct Zero {
  double time_s = 0.0;
  double speed = 0.0;
};

// Where the sum passes 0 within [0, span_s).
std::vector<Zero> zeros_of(const Sinusoids& lines, double span_s) {
  const auto at = [&](double t) {
    SignalPoint p;
    for (Index k = 0; k < lines.freq_hz.size(); ++k) {
      const double w = 2.0 * kPi * lines.freq_hz[k];
      p.value += lines.amplitude[k] * std::cos(w * t + lines.phase_rad[k]);
      p.rate -= lines.amplitude[k] * w * std::sin(w * t + lines.phase_rad[k]);
    }
    return p;
  };
  const Index steps =
      std::max<Index>(64, static_cast<Index>(16.0 * lines.freq_hz.maxCoeff() * span_s));
  std::vector<Zero> out;
  double before = at(0.0).value;
  for (Index i = 1; i <= steps; ++i) {
    const double t = span_s * static_cast<double>(i) / static_cast<double>(steps);
    const double now = at(t).value;
    if ((before < 0.0) != (now < 0.0)) {
      double low = span_s * static_cast<double>(i - 1) / static_cast<double>(steps);
      double high = t;
      for (int b = 0; b < 60; ++b) {
        const double middle = 0.5 * (low + high);
        ((at(middle).value < 0.0) == (before < 0.0) ? low : high) = middle;
      }
      out.push_back({low, std::abs(at(low).rate)});
    }
    before = now;
  }
  return out;
}

// How much one axis repeats another with the same lines, in phase or a quarter of a cycle apart: 1
// when it is the same wave.
double likeness(const Sinusoids& lines, const Sinusoids& other) {
  Complex sum = 0.0;
  for (Index k = 0; k < lines.freq_hz.size(); ++k) {
    sum += std::polar(lines.amplitude[k] * lines.amplitude[k],
                      lines.phase_rad[k] - other.phase_rad[k]);
  }
  return std::abs(sum) / lines.amplitude.squaredNorm();
}

// Where an axis begins: where it passes 0 most slowly, or, beside axes that share its lines, where
// it is least like them. The best phases of all of them are the same wave: begun together, the hand
// would move along a line.
double start_of(const Sinusoids& lines, double span_s, const std::vector<Sinusoids>& beside) {
  double best = 0.0;
  double least = kInfinity;
  for (const Zero& zero : zeros_of(lines, span_s)) {
    double cost = beside.empty() ? zero.speed : 0.0;
    for (const Sinusoids& other : beside) {
      cost = std::max(cost, likeness(begun_at(lines, zero.time_s), other));
    }
    if (cost < least) {
      least = cost;
      best = zero.time_s;
    }
  }
  return best;
}

// Adds one axis' lines to column `axis`. A block's samples are the block's first turned by powers
// of one rotation: a sine and a cosine for every 256 samples, exact to a few roundings.
void add_lines(const Sinusoids& lines, Index axis, Excitation& out) {
  constexpr Index kBlock = 256;
  const Index rows = out.rows();
  Eigen::VectorXcd turn(kBlock);
  for (Index k = 0; k < lines.freq_hz.size(); ++k) {
    const double w = 2.0 * kPi * lines.freq_hz[k];
    for (Index i = 0; i < kBlock; ++i) {
      turn[i] = std::polar(1.0, w * static_cast<double>(i) / out.rate_hz);
    }
    for (Index begin = 0; begin < rows; begin += kBlock) {
      // Whole cycles are taken off first: large arguments lose digits.
      const double cycles = lines.freq_hz[k] * static_cast<double>(begin) / out.rate_hz;
      const Complex first = std::polar(
          lines.amplitude[k], 2.0 * kPi * (cycles - std::floor(cycles)) + lines.phase_rad[k]);
      const Index count = std::min(kBlock, rows - begin);
      double* value = &out.value(begin, axis);
      double* rate = &out.rate(begin, axis);
      double* acceleration = &out.acceleration(begin, axis);
      for (Index i = 0; i < count; ++i) {
        const double re = first.real() * turn[i].real() - first.imag() * turn[i].imag();
        const double im = first.real() * turn[i].imag() + first.imag() * turn[i].real();
        value[i] += re;
        rate[i] -= w * im;
        acceleration[i] -= w * w * re;
      }
    }
  }
}

void fade(Excitation& out, double fade_s) {
  if (fade_s <= 0.0) return;
  const Index rows = out.rows();
  const Index count = std::min(rows, static_cast<Index>(std::ceil(fade_s * out.rate_hz)));
  const auto weigh = [&](Index row, const SignalPoint& w) {
    for (Index a = 0; a < out.axes(); ++a) {
      const double u = out.value(row, a);
      const double v = out.rate(row, a);
      out.acceleration(row, a) =
          w.acceleration * u + 2.0 * w.rate * v + w.value * out.acceleration(row, a);
      out.rate(row, a) = w.rate * u + w.value * v;
      out.value(row, a) = w.value * u;
    }
  };
  for (Index i = 0; i < count; ++i) {
    const double t = static_cast<double>(i) / out.rate_hz / fade_s;
    SignalPoint rise = smooth_rise(t);
    rise.rate /= fade_s;
    rise.acceleration /= fade_s * fade_s;
    weigh(i, rise);
    SignalPoint fall = rise;
    fall.rate = -fall.rate;
    weigh(rows - 1 - i, fall);
  }
}

std::string periods_words(const MultisineSpec& spec, const Matrix& freq, double used_s,
                          double period_s) {
  if (spec.lines_hz.size() > 0) {
    Index broken = 0;
    double first = 0.0;
    for (const double f : freq.reshaped()) {
      const double cycles = f * used_s;
      if (std::abs(cycles - std::round(cycles)) <= kWholeCycles * std::max(1.0, cycles)) continue;
      if (broken++ == 0) first = f;
    }
    if (broken == 0) {
      return sentence(6, "Every line makes whole cycles in the ", used_s,
                      " s: spectra over them do not leak.");
    }
    return sentence(6, broken, " of ", freq.size(), " lines, the first at ", first,
                    " Hz, make no whole number of cycles in the ", used_s,
                    " s: spectra over them leak.");
  }
  const double periods = used_s / period_s;
  if (std::abs(periods - std::round(periods)) <= kWholeCycles * periods) {
    return sentence(6, "The period is ", period_s, " s, ", std::round(periods),
                    std::round(periods) == 1.0 ? " time" : " times",
                    " in the record: spectra over whole periods do not leak.");
  }
  if (periods < 1.0) {
    return sentence(6, "The period of ", period_s, " s is longer than the ", used_s,
                    " s that are used: spectra leak, and the axes are not separated line by line.");
  }
  return sentence(6, "The period is ", period_s, " s, ", periods,
                  " times in the record: take the first ", std::floor(periods) * period_s,
                  " s for spectra without leakage.");
}

const char* phases_word(Phases phases) {
  switch (phases) {
    case Phases::kOptimised:
      return "optimised";
    case Phases::kRandom:
      return "random";
    case Phases::kSchroeder:
      return "Schroeder's";
  }
  return "";
}

}  // namespace

Excitation multisine(const MultisineSpec& spec, Token* token) {
  check(spec);
  const Index n = spec.amplitude.size();
  Excitation out;
  out.drive = spec.drive;
  out.rate_hz = spec.rate_hz;
  const Index rows = rows_of(spec.duration_s, spec.rate_hz, "duration_s");
  const Index fade_rows = static_cast<Index>(std::llround(spec.fade_s * spec.rate_hz));
  const double fade_s = static_cast<double>(fade_rows) / spec.rate_hz;
  require(rows > 2 * fade_rows + 1, "fade_s", "two fades must leave a part of the duration");
  const double used_s = static_cast<double>(rows - 2 * fade_rows) / spec.rate_hz;
  require(std::isfinite(spec.period_s) && spec.period_s >= 0.0, "period_s",
          "the period must be a positive number of seconds");
  const double period_s = spec.period_s > 0.0 ? spec.period_s : used_s;
  const bool on_grid = spec.lines_hz.size() == 0;
  const Matrix freq = frequencies(spec, period_s);
  const bool shared =
      spec.shared ||
      (n > 1 && !on_grid && freq.colwise().maxCoeff().isConstant(freq.col(0).maxCoeff(), 0.0));
  out.value = out.rate = out.acceleration = Matrix::Zero(rows, n);
  out.segments = {{fade_rows, rows - fade_rows}};
  // Without a period of its own, a sum of arbitrary lines is judged over what is used.
  const double longest_s = on_grid ? std::min(period_s, used_s) : used_s;
  out.period_s = on_grid ? period_s : 0.0;

  std::vector<Sinusoids> beside;  // axes before that have the same lines
  for (Index a = 0; a < n; ++a) {
    Sinusoids lines{freq.col(a), freq.col(a).array().pow(spec.slope), Vector()};
    const double span_s = repeats_after(lines.freq_hz, longest_s);
    const auto stream = static_cast<std::uint64_t>(a);
    lines.phase_rad = schroeder_phases(lines.amplitude);
    if (spec.phases == Phases::kRandom) {
      Random random(spec.seed, stream);
      for (double& phase : lines.phase_rad) phase = 2.0 * kPi * random.uniform();
    } else if (spec.phases == Phases::kOptimised) {
      lines.phase_rad = low_crest_phases(lines, span_s, spec.starts, spec.seed, stream, token);
    }
    lines = begun_at(lines, start_of(lines, span_s, beside));
    if (shared) beside.push_back(lines);
    lines = begun_at(lines, -fade_s);
    add_lines(lines, a, out);
    const auto used = out.value.col(a).segment(fade_rows, rows - 2 * fade_rows);
    const double size = spec.rms ? std::sqrt(used.squaredNorm() / static_cast<double>(used.size()))
                                 : used.cwiseAbs().maxCoeff();
    const double factor = spec.amplitude[a] / size;
    out.value.col(a) *= factor;
    out.rate.col(a) *= factor;
    out.acceleration.col(a) *= factor;
    for (Index k = 0; k < lines.freq_hz.size(); ++k) {
      out.lines.push_back({a, lines.freq_hz[k], factor * lines.amplitude[k], lines.phase_rad[k]});
    }
    step(token, static_cast<double>(a + 1) / static_cast<double>(n));
  }
  fade(out, fade_s);

  out.notes.push_back(periods_words(spec, freq, used_s, period_s));
  if (n > 1 && shared) {
    out.notes.push_back(
        "The axes share their lines: a model can be fitted, but a frequency response measured "
        "line by line cannot tell the axes apart; use lines that take turns for that.");
  }
  if (fade_rows == 0) {
    const double jump = out.rate.row(0).cwiseAbs().maxCoeff();
    out.notes.push_back(sentence(
        3, "The design starts at 0 with a speed of ", jump,
        " per second and ends in motion: give it a fade where the robot must start from rest."));
  }
  out.provenance = sentence(9, "design: multisine, ", freq.rows(), " lines for each of ", n,
                            n == 1 ? " axis" : " axes", ", ", freq.minCoeff(), " to ",
                            freq.maxCoeff(), " Hz, ", phases_word(spec.phases), " phases, seed ",
                            spec.seed, ", ", spec.duration_s, " s at ", spec.rate_hz, " Hz");
  return out;
}

}  // namespace ulna
