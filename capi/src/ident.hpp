// Options of the preparation, shared by the headers that use them.
#pragma once

#include <ulna/ident.h>

#include <string>

#include "ident/consistency.hpp"
#include "ident/prepare.hpp"

namespace ulna::capi {

struct PrepareRequest {
  PrepareOptions options;
  std::string position, force, reference;
  int threads = 0;
};

PrepareRequest prepare_request(const ulna_prepare_options* options);
ulna_prepare_report prepare_report(const Prepared& prepared);
ulna_prepare_report prepare_report(const PrepareReport& report,
                                   const DerivativeConsistency& consistency);

}  // namespace ulna::capi
