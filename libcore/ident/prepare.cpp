#include "ident/prepare.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "base/error.hpp"
#include "base/pool.hpp"
#include "signal/butterworth.hpp"
#include "signal/matched.hpp"
#include "signal/response.hpp"
#include "signal/savgol.hpp"
#include "signal/spectrum.hpp"

namespace ulna {
namespace {

constexpr double kDefaultLowpassHz = 5.0;   // Dyck 2013: movements of 0 to 3 Hz
constexpr double kLargestLowpassHz = 60.0;  // the fastest single-joint perturbations in use
// The published pair, 101 samples and 5 Hz at 1 kHz, kept in proportion at other cut-offs.
constexpr double kWindowTimesLowpass = 0.505;
constexpr int kDefaultOrder = 6;
constexpr Index kLeastRows = 16;  // of a trial: the smallest window twice
constexpr int kDefaultLowpassOrder = 5;
// The filters take rows as equidistant; a step that strays by less than this changes nothing
// visible.
constexpr double kClockTolerance = 0.02;
constexpr double kLargestValue = 1e12;  // in SI: nothing at an arm comes near it

std::string seconds(double value) {
  std::ostringstream text;
  text.precision(6);
  text << value << " s";
  return text.str();
}

// A gap comes before jitter: a record with both has to be split before it can be regularised.
void require_uniform(const Record& record) {
  const double step = 1.0 / record.rate_hz();
  const auto refuse_beyond = [&](double least, double most, const char* what, const char* advice) {
    for (const Trial& trial : record.trials()) {
      for (Index row = trial.begin + 1; row < trial.end; ++row) {
        const auto r = static_cast<std::size_t>(row);
        const double ratio = (record.time()[r] - record.time()[r - 1]) / step;
        if (ratio >= least && ratio <= most) continue;
        throw Error(Fault::kData, "time",
                    std::string(what) + " before row " + std::to_string(row) + " (" +
                        seconds(record.time()[r]) + "): a step of " + seconds(ratio * step) +
                        " instead of " + seconds(step) + "; " + advice,
                    "row " + std::to_string(row));
      }
    }
  };
  refuse_beyond(0.0, 1.5, "samples are missing", "split the record there");
  refuse_beyond(1.0 - kClockTolerance, 1.0 + kClockTolerance, "the time stamps jitter",
                "regularise the record first");
}

void require_complete(const Record& record, const std::vector<Index>& channels) {
  for (const Index c : channels) {
    const Channel& channel = record.channels()[static_cast<std::size_t>(c)];
    bool all_zero = true;
    bool constant = true;
    for (const Trial& trial : record.trials()) {
      for (Index row = trial.begin; row < trial.end; ++row) {
        const double value = record.values()(row, c);
        if (!std::isfinite(value)) {
          Index end = row;
          while (end < trial.end && !std::isfinite(record.values()(end, c))) ++end;
          throw Error(Fault::kData, channel.name,
                      "channel " + channel.name + " has no number in " + std::to_string(end - row) +
                          (end - row == 1 ? " row" : " rows") + " from row " + std::to_string(row) +
                          "; split the record there or repair it",
                      "row " + std::to_string(row));
        }
        if (std::abs(value) > kLargestValue) {
          std::ostringstream text;
          text << "channel " << channel.name << " holds " << value << " " << channel.unit
               << " at row " << row
               << ", which is no physical value: repair it or split the record there";
          throw Error(Fault::kData, channel.name, text.str(), "row " + std::to_string(row));
        }
        all_zero = all_zero && value == 0.0;
        constant = constant && value == record.values()(record.trials().front().begin, c);
      }
    }
    if (all_zero && channel.role == Role::kForce) {
      throw Error(
          Fault::kData, channel.name,
          "channel " + channel.name + " is zero throughout: was the force sensor connected?");
    }
    if (constant) {
      throw Error(Fault::kData, channel.name,
                  "channel " + channel.name + " is constant: nothing can be learnt from it");
    }
  }
}

struct Plan {
  SavgolSpec spec;
  Matrix kernels;
  Sos sos;
  bool lowpass = false;
  ZeroPhase zero_phase;
};

// Numbers filtered at a time: a long recording passes in pieces, so that the filter's buffers stay
// small and a cancelled call stops soon.
constexpr Index kPieceSize = Index{1} << 21;
// Neighbours of a piece are filtered with it until the low pass has forgotten where they began.
constexpr double kForgotten = 1e-15;

// Smoothed signals at rows [first, first + out.rows()) of those with a full window; columns as in
// PreparedTrial.
void smooth(const Record& record, const Trial& trial, const Roles& roles, const Plan& plan,
            Index first, Eigen::Ref<Matrix> out) {
  const Index rows = out.rows();
  const auto raw = [&](Index channel) {
    return record.column(channel).segment(trial.begin + first, rows + plan.spec.window - 1);
  };
  Matrix three(rows, 3);
  const auto differentiate = [&](const std::vector<Index>& channels, Index at) {
    const Index count = static_cast<Index>(channels.size());
    for (Index k = 0; k < count; ++k) {
      savgol_correlate(plan.kernels, raw(channels[static_cast<std::size_t>(k)]), three);
      for (Index d = 0; d < 3; ++d) out.col(at + d * count + k) = three.col(d);
    }
  };
  const Index n = static_cast<Index>(roles.position.size());
  differentiate(roles.position, 0);
  const Matrix value_kernel = plan.kernels.leftCols(1);
  for (Index k = 0; k < n; ++k) {
    savgol_correlate(value_kernel, raw(roles.force[static_cast<std::size_t>(k)]),
                     out.middleCols(3 * n + k, 1));
  }
  differentiate(roles.reference, 4 * n);
}

PreparedTrial prepare_trial(const Record& record, const Trial& trial, const Roles& roles,
                            const Plan& plan, const Token* token) {
  const Index half = savgol_edge_rows(plan.spec);
  const Index rows = trial.end - trial.begin - 2 * half;
  const Index n = static_cast<Index>(roles.position.size());
  const Index m = static_cast<Index>(roles.reference.size());
  Matrix table(rows, 4 * n + 3 * m);
  const Index piece = kPieceSize / table.cols();
  const Index margin = plan.lowpass ? settle_samples(plan.sos, kForgotten) : 0;
  if (rows <= piece + 2 * margin) {
    smooth(record, trial, roles, plan, 0, table);
    if (plan.lowpass) filter_zero_phase(plan.sos, plan.zero_phase, table);
  } else {
    Matrix wide;
    for (Index begin = 0; begin < rows; begin += piece) {
      if (token != nullptr && token->cancelled()) {
        throw Error(Fault::kCancelled, "token", "the call was cancelled");
      }
      const Index end = std::min(rows, begin + piece);
      const Index first = std::max<Index>(0, begin - margin);
      const Index last = std::min(rows, end + margin);
      wide.resize(last - first, table.cols());
      smooth(record, trial, roles, plan, first, wide);
      if (plan.lowpass) filter_zero_phase(plan.sos, plan.zero_phase, wide);
      table.middleRows(begin, end - begin) = wide.middleRows(begin - first, end - begin);
    }
  }
  return {trial.begin + half, n, m, std::move(table)};
}

// -3 dB frequency of the value kernel times the two passes of the low pass (null: none).
double effective_cutoff(VectorRef value_kernel, const Sos* sos, double rate_hz) {
  const Index half = (value_kernel.size() - 1) / 2;
  const auto gain = [&](double frequency) {
    double sum = value_kernel[half];
    for (Index k = 1; k <= half; ++k) {
      sum += 2.0 * value_kernel[half + k] *
             std::cos(2.0 * kPi * frequency / rate_hz * static_cast<double>(k));
    }
    if (sos == nullptr) return sum;
    const double once = sos_gain(*sos, rate_hz, Vector::Constant(1, frequency))[0];
    return sum * once * once;
  };
  double low = 0.0;
  double high = 0.5 * rate_hz;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (gain(middle) > std::sqrt(0.5) ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

int odd_at_least(double wanted, int least) {
  const int odd = 2 * static_cast<int>(std::lround((wanted - 1.0) / 2.0)) + 1;
  return std::max(odd, least);
}

}  // namespace

Roles find_roles(const Record& record, const std::string& position, const std::string& force,
                 const std::string& reference) {
  const auto pick = [&](const std::string& word, Role role, const char* argument) {
    try {
      if (word.empty()) return record.with_role(role);
      if (word.find(',') == std::string::npos) return record.resolve(word);
      std::vector<Index> exact;
      std::istringstream names(word);
      for (std::string name; std::getline(names, name, ',');) exact.push_back(record.find(name));
      return exact;
    } catch (const Error& error) {
      throw Error(error.fault(), argument, error.what(), error.detail());
    }
  };
  Roles roles{pick(position, Role::kPosition, "position"), pick(force, Role::kForce, "force"),
              pick(reference, Role::kReference, "reference")};
  std::string names;
  for (const Channel& channel : record.channels()) {
    names += (names.empty() ? "" : ", ") + channel.name;
  }
  const auto need = [&](bool good, const char* argument, const std::string& problem) {
    if (!good) {
      throw Error(Fault::kData, argument,
                  problem + " (the channels are " + names + "); name them in a map");
    }
  };
  need(!roles.position.empty(), "position", "no channel is known to be a position");
  for (const Index c : roles.position) {
    const auto is_also = [c](const std::vector<Index>& others) {
      return std::find(others.begin(), others.end(), c) != others.end();
    };
    const std::string& name = record.channels()[static_cast<std::size_t>(c)].name;
    need(!is_also(roles.force), "force", "channel " + name + " cannot be position and force");
    need(!is_also(roles.reference), "reference",
         "channel " + name +
             " cannot be position and reference: the reference is what was commanded");
  }
  need(!roles.force.empty(), "force", "no channel is known to be a force or torque");
  need(roles.position.size() == roles.force.size(), "force",
       "there are " + std::to_string(roles.position.size()) + " position and " +
           std::to_string(roles.force.size()) + " force channels; every axis needs one of each");
  need(roles.position.size() <= 6, "position", "more than 6 axes cannot be identified at once");
  return roles;
}

double motion_band(const Record& record, const std::vector<Index>& channels, double share,
                   double max_hz) {
  Index longest = 0;
  for (const Trial& trial : record.trials()) longest = std::max(longest, trial.end - trial.begin);
  const Index segment = std::min<Index>(longest, static_cast<Index>(4.0 * record.rate_hz()));
  std::vector<RowRange> ranges;
  for (const Trial& trial : record.trials()) {
    // Twelve seconds of each of fifty trials tell the band as well as all of them.
    if (ranges.size() < 50 && trial.end - trial.begin >= segment) {
      const Index most = std::max(segment, static_cast<Index>(12.0 * record.rate_hz()));
      ranges.push_back({trial.begin, std::min(trial.end, trial.begin + most)});
    }
  }
  double band = 0.0;
  for (const Index c : channels) {
    const Spectra spectra =
        welch(record.values().middleCols(c, 1), record.rate_hz(), segment, ranges);
    double total = 0.0;
    for (Index pass = 0, k = 0; pass < 2; ++pass) {
      double sum = 0.0;
      for (k = 1; k < spectra.freq_hz.size() && spectra.freq_hz[k] <= max_hz; ++k) {
        const double f = spectra.freq_hz[k];
        sum += f * f * spectra.s[static_cast<std::size_t>(k)](0, 0).real();
        if (pass == 1 && sum >= share * total) break;
      }
      if (pass == 0) {
        total = sum;
      } else if (total > 0.0 && k < spectra.freq_hz.size()) {
        band = std::max(band, spectra.freq_hz[k]);
      }
    }
  }
  return band;
}

Prepared prepare(const Record& record, const Roles& roles, const PrepareOptions& options,
                 int threads, Token* token) {
  require(options.window >= 0, "window", "the window must not be negative");
  require(options.order >= 0 && options.order <= 100, "order",
          "the polynomial order must be from 2 to 100");
  require(options.lowpass_hz <= 0.0 || options.lowpass_hz >= 0.01, "lowpass_hz",
          "a low pass below 0.01 Hz leaves nothing of a movement");
  require(options.lowpass_order >= 0 && options.lowpass_order <= 20, "lowpass_order",
          "the order of the low pass must be from 1 to 20");
  for (const Trial& trial : record.trials()) {
    if (trial.end - trial.begin >= kLeastRows) continue;
    throw Error(Fault::kData, "time",
                "the trial that starts at row " + std::to_string(trial.begin) + " has only " +
                    std::to_string(trial.end - trial.begin) +
                    " samples, too few to smooth and differentiate",
                "row " + std::to_string(trial.begin));
  }
  require_uniform(record);
  for (const auto* channels : {&roles.position, &roles.force, &roles.reference}) {
    require_complete(record, *channels);
  }
  const double rate = record.rate_hz();
  Prepared out;
  out.roles = roles;
  PrepareReport& report = out.report;
  report.rate_hz = rate;
  // The band of the perturbation where it is known: the human's tremor lies above it.
  report.motion_band_hz = motion_band(
      record, roles.reference.empty() ? roles.position : roles.reference, 0.95, 0.2 * rate);
  report.lowpass_order = options.lowpass_order == 0 ? kDefaultLowpassOrder : options.lowpass_order;
  report.lowpass_chosen = options.lowpass_hz == 0.0;
  double lowpass = options.lowpass_hz;
  if (report.lowpass_chosen) {
    // Both passes together have to pass the band of the motion.
    const double most = std::min(kLargestLowpassHz, 0.2 * rate);
    const double least = std::min(kDefaultLowpassHz, most);
    const double band = std::min(report.motion_band_hz, most);
    lowpass = band > 0.5 * least ? corrected_cutoff(report.lowpass_order, band, rate) : least;
    lowpass = std::clamp(lowpass, least, most);
  }
  require(
      std::isfinite(lowpass) && lowpass < 0.5 * rate, "lowpass_hz",
      "the low pass must lie below half the sampling rate, " + std::to_string(0.5 * rate) + " Hz");
  if (options.corrected && options.lowpass_hz > 0.0) {
    lowpass = corrected_cutoff(report.lowpass_order, lowpass, rate);
  }

  Plan plan;
  plan.lowpass = lowpass > 0.0;
  report.order = options.order == 0 ? kDefaultOrder : options.order;
  report.window = options.window;
  if (report.window == 0) {
    const double cutoff = plan.lowpass ? lowpass : kDefaultLowpassHz;
    report.window =
        odd_at_least(kWindowTimesLowpass * rate / cutoff, report.order + 3 + report.order % 2);
  }
  plan.spec = {report.window, report.order};
  check_savgol(plan.spec, 2);
  require(report.order >= 2, "order",
          "the polynomial order must be at least 2 to give accelerations");
  plan.zero_phase = report.zero_phase = options.zero_phase;
  if (plan.lowpass) {
    plan.sos = butterworth_lowpass(report.lowpass_order, lowpass, rate);
    report.lowpass_hz = lowpass;
    report.pad_rows = pad_samples(plan.sos, plan.zero_phase);
    report.transient_rows = settle_samples(plan.sos, options.zero_phase.epsilon);
  } else {
    report.lowpass_order = 0;
  }
  // Matching costs noise above the band, which only a low pass takes away again.
  plan.kernels = options.plain_savgol || !plan.lowpass
                     ? savgol_kernels(plan.spec, 2, rate)
                     : matched_kernels(plan.spec, 2, rate, 2.0 * lowpass);
  report.effective_cutoff_hz =
      effective_cutoff(plan.kernels.col(0), plan.lowpass ? &plan.sos : nullptr, rate);
  report.dropped_rows = savgol_edge_rows(plan.spec);

  // A trial has to hold the windows and something to fit beside.
  for (const Trial& trial : record.trials()) {
    const Index rows = trial.end - trial.begin;
    const Index least = 2 * report.window;
    if (rows < least) {
      throw Error(Fault::kData, "time",
                  "the trial that starts at row " + std::to_string(trial.begin) + " has only " +
                      std::to_string(rows) + " samples; a window of " +
                      std::to_string(report.window) + " needs at least " + std::to_string(least),
                  "row " + std::to_string(trial.begin));
    }
    report.short_trials = report.short_trials || rows - 2 * report.dropped_rows <= report.pad_rows;
  }

  out.trials.resize(record.trials().size());
  parallel_for(
      static_cast<std::ptrdiff_t>(out.trials.size()), threads,
      [&](std::ptrdiff_t i) {
        const auto k = static_cast<std::size_t>(i);
        out.trials[k] = prepare_trial(record, record.trials()[k], roles, plan, token);
      },
      token);
  return out;
}

}  // namespace ulna
