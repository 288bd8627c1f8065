// Frequency response to periodic excitation (a multisine, a repeated sequence): averages over
// periods, with the noise measured by what differs from period to period. Nothing leaks, and noise
// on the input makes no bias that averaging does not remove (Pintelon and Schoukens 2012, 2.5).
#pragma once

#include "signal/spectrum.hpp"

namespace ulna {

// Throws Error (kArgument) unless a period has 4 samples and fits into the rows.
void check_period(Index period, Index rows);

// period: samples; skip: whole periods left out at the start of every range while transients decay.
// Every range holds at least two more. Several inputs need as many ranges in which they differ.
// Harmonics 0 ... period / 2; NaN at 0 and where the inputs are dependent or have no power above
// their own noise. radius: |H - truth|^2 over its variance is F(2, 2 nu), nu the periods less one a
// range.
FrequencyResponse periodic_response(MatrixRef inputs, MatrixRef outputs, double rate_hz,
                                    Index period, Index skip, const std::vector<RowRange>& ranges,
                                    double confidence = 0.95, Token* token = nullptr);

}  // namespace ulna
