#include "impedance/profile.hpp"

namespace ulna {

Eigen::Vector2d likely_range(const Vector& at, const Vector& distance, double limit) {
  const Index last = at.size() - 1;
  const auto crossing = [&](Index outside, Index inside) {
    const double share = (limit - distance[inside]) / (distance[outside] - distance[inside]);
    return at[inside] + share * (at[outside] - at[inside]);
  };
  Index low = 0;
  while (low < last && distance[low] > limit) ++low;
  Index high = last;
  while (high > 0 && distance[high] > limit) --high;
  return {low == 0 ? at[0] : crossing(low - 1, low),
          high == last ? at[last] : crossing(high + 1, high)};
}

}  // namespace ulna
