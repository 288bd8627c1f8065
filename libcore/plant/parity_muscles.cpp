#include "plant/parity_muscles.hpp"

#include "base/error.hpp"

namespace ulna {
namespace {

// length = upper scale * a + forearm scale * b + c, for the shortest and the longest.
struct LengthPlanes {
  const char* muscle;
  double shortest[3];
  double longest[3];
};

constexpr LengthPlanes kElbowPlanes[] = {
    {"triceps_long", {0.289886, -0.016197, 0.014814}, {0.289839, 0.030525, 0.015959}},
    {"triceps_medial", {0.110254, -0.007723, 0.0000954}, {0.114715, 0.032310, 0.0000226}},
    {"triceps_lateral", {0.217459, -0.019397, 0.0000325}, {0.218874, 0.031326, 0.0000115}},
    {"anconeus", {-0.012068, 0.030644, 0.0000745}, {0.015429, 0.032208, 0.0000166}},
    {"biceps_short", {0.286804, -0.037002, -0.037176}, {0.289242, 0.053333, -0.036683}},
    {"biceps_long", {0.306832, -0.038428, 0.023691}, {0.309014, 0.052232, 0.023665}},
    {"brachialis", {0.115704, -0.016341, 0.0000857}, {0.119760, 0.034662, 0.0000160}},
    {"brachioradialis", {-0.033639, 0.272109, 0.000123}, {0.073071, 0.280340, 0.0000042}}};

struct LengthRange {
  const char* muscle;
  double shortest, longest;
};

constexpr LengthRange kShoulderRanges[] = {{"pectoralis_clavicular", 0.067, 0.22},
                                           {"pectoralis_sternal", 0.17, 0.31},
                                           {"pectoralis_ribs", 0.18, 0.31},
                                           {"coracobrachialis", 0.12, 0.2},
                                           {"supraspinatus", 0.061, 0.11},
                                           {"deltoid_clavicular", 0.028, 0.19},
                                           {"deltoid_anterior", 0.022, 0.19},
                                           {"deltoid_middle", 0.076, 0.14},
                                           {"infraspinatus", 0.085, 0.13},
                                           {"subscapularis", 0.068, 0.11},
                                           {"teres_minor", 0.045, 0.1},
                                           {"teres_major", 0.055, 0.2},
                                           {"latissimus_thoracic", 0.17, 0.26},
                                           {"latissimus_lumbar", 0.24, 0.33},
                                           {"latissimus_iliac", 0.21, 0.3}};

}  // namespace

PublishedLengths published_lengths(const std::string& muscle, double upper_scale,
                                   double fore_scale) {
  for (const LengthPlanes& p : kElbowPlanes) {
    if (muscle != p.muscle) continue;
    const auto at = [&](const double(&plane)[3]) {
      return upper_scale * plane[0] + fore_scale * plane[1] + plane[2];
    };
    return {at(p.shortest), at(p.longest)};
  }
  for (const LengthRange& r : kShoulderRanges) {
    if (muscle == r.muscle) return {r.shortest, r.longest};
  }
  throw Error(Fault::kArgument, "muscle", "muscle '" + muscle + "' is not among the published");
}

}  // namespace ulna
