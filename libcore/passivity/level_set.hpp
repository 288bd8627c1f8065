// The smallest value of a function of frequency, with a certificate: after each local minimum, an
// oracle gives every frequency at which the function can cross a level just below it, and the
// function is evaluated between all of them (Boyd and Balakrishnan 1990; Bruinsma and Steinbuch
// 1990). Frequencies of the oracle that are no crossings cost an evaluation and do no harm.
#pragma once

#include <functional>
#include <vector>

namespace ulna {

// Frequencies in rad/s, 0 <= low <= high; high may be infinite.
struct Band {
  double low = 0.0;
  double high = 0.0;

  bool holds(double omega) const { return omega >= low && omega <= high; }
};

struct Extremum {
  double value = 0.0;
  double omega = 0.0;
};

struct LevelSetProblem {
  // Also at 0 and at infinity.
  std::function<double(double)> value;
  // A superset of the frequencies at which the value equals the level.
  std::function<std::vector<double>(double)> crossings;
  // Error of a value there, absolute: the certificate is below it by that much.
  std::function<double(double)> resolution;
};

// start: frequencies at which a minimum is likely. Ends of the band are added.
Extremum smallest(const LevelSetProblem& problem, const std::vector<double>& start,
                  const Band& band);

// Frequencies that separate what lies between the given ones: themselves, points between
// neighbours, one below and one above, all inside of the band, increasing.
std::vector<double> with_midpoints(std::vector<double> omega, const Band& band);

}  // namespace ulna
