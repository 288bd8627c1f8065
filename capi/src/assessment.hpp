// How protocols, estimators and plants of the interface become those of the core.
#pragma once

#include <ulna/assessment.h>
#include <ulna/soft.h>

#include "impedance/viscoelastic.hpp"
#include "plant/soft/reduced_plant.hpp"
#include "sim/mobilisation.hpp"

namespace ulna::capi {

// Throw Error (kArgument) for what cannot be.
sim::Protocol read_protocol(const ulna_protocol* options);
ViscoelasticOptions read_estimator(const ulna_viscoelastic_options* options);
SoftScene read_soft(const ExoScene& scene, const ulna_soft_options& options);
ReductionOptions read_reduction(const ulna_reduction_options* options);

// The scene that a plant was made from; throws Error (kUnsupported) where there is none.
const ExoScene& read_description(const ulna_plant& plant);

// The record of a mobilisation as a new handle; throws Error (kData) where there is none.
void give_log(ulna_record** place, const sim::Mobilisation& mobilisation);

}  // namespace ulna::capi
