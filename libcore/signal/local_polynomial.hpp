// Frequency response by the local polynomial method (Pintelon, Schoukens, Vandersteen and Barbe
// 2010): around every frequency the response and the transient that leaks into the record are
// smooth, so both are fitted by polynomials in frequency. Finer than Welch's method at the same
// variance, and free of leakage; the residual of the fit gives the confidence region.
#pragma once

#include "signal/spectrum.hpp"

namespace ulna {

struct LocalPolynomial {
  Index order = 2;       // of the polynomials, 0 to 6
  Index half_width = 0;  // bins to either side; 0: so that 10 degrees of freedom are left
  Index stride = 0;      // bins from one frequency to the next; 0: half_width
};

// Frequencies that local_response gives for so many rows; options filled in.
Vector local_frequencies(Index rows, Index inputs, double rate_hz,
                         const std::vector<RowRange>& ranges, LocalPolynomial& options);

struct LocalResponse {
  FrequencyResponse response;
  Coherence coherence;  // share of each output's power, transient aside, that the inputs explain
};

// All ranges are cut to the length of the shortest one. Throws Error for shapes, options, values
// that are not finite, and too few rows.
LocalResponse local_response(MatrixRef inputs, MatrixRef outputs, double rate_hz,
                             const std::vector<RowRange>& ranges, LocalPolynomial options,
                             double confidence = 0.95, Token* token = nullptr);

}  // namespace ulna
