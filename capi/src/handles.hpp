// What stands behind the typed pointers of the interface.
#pragma once

#include <ulna/base.h>

#include <memory>
#include <vector>

#include "base/token.hpp"
#include "impedance/estimate.hpp"
#include "passivity/verdict.hpp"
#include "plant/planar_robot.hpp"
#include "record/csv.hpp"

struct ulna_token {
  ulna::Token token;
};

struct ulna_record {
  ulna::Record record;
  std::vector<ulna::Finding> findings;
  ulna::Source source;
  bool is_text = false;  // the source was a text table
};

struct ulna_impedance {
  ulna::ImpedanceEstimate estimate;
};

struct ulna_passivity {
  ulna::Verdict verdict;
};

struct ulna_robot {
  std::shared_ptr<const ulna::PlanarRobot> robot;
};

namespace ulna::capi {
inline Token* token_of(ulna_token* handle) noexcept {
  return handle == nullptr ? nullptr : &handle->token;
}
}  // namespace ulna::capi
