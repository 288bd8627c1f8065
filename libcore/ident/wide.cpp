#include "ident/wide.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "base/error.hpp"
#include "base/words.hpp"
#include "signal/butterworth.hpp"

namespace ulna {

double chosen_lowpass(const Record& record, const std::vector<Index>& channels,
                      const PrepareOptions& options) {
  // As in prepare: both passes together pass 95 % of the motion, from 5 to 60 Hz.
  const double rate = record.rate_hz();
  const double most = std::min(60.0, 0.2 * rate);
  const double least = std::min(5.0, most);
  const double band = std::min(motion_band(record, channels, 0.95, 0.2 * rate), most);
  const int order = options.lowpass_order == 0 ? 5 : options.lowpass_order;
  const double lowpass = band > 0.5 * least ? corrected_cutoff(order, band, rate) : least;
  return std::clamp(lowpass, least, most);
}

PrepareOptions wide_options(const Record& record, const std::vector<Index>& channels,
                            const PrepareOptions& options, double times) {
  PrepareOptions out = options;
  if (options.lowpass_hz != 0.0) return out;
  out.lowpass_hz =
      std::min(times * chosen_lowpass(record, channels, options), 0.2 * record.rate_hz());
  out.corrected = false;
  return out;
}

void drop_transients(Prepared& prepared, const Record& record) {
  const Index cut = prepared.report.transient_rows;
  if (cut == 0) return;
  for (PreparedTrial& trial : prepared.trials) {
    const Index rows = trial.rows() - 2 * cut;
    if (rows < 2 * prepared.report.window) {
      const double rate = record.rate_hz();
      throw Error(
          Fault::kData, "time",
          sentence(4, "the trial at row ", trial.begin(), " lasts ",
                   static_cast<double>(trial.rows()) / rate, " s, of which the low pass at ",
                   prepared.report.lowpass_hz, " Hz spoils ", static_cast<double>(cut) / rate,
                   " s at either end: record longer, or raise the low pass"),
          "row " + std::to_string(trial.begin()));
    }
    const Index n = static_cast<Index>(prepared.roles.position.size());
    const Index m = static_cast<Index>(prepared.roles.reference.size());
    trial = PreparedTrial(trial.begin() + cut, n, m, trial.table().middleRows(cut, rows));
  }
  prepared.report.dropped_rows += cut;
}

}  // namespace ulna
