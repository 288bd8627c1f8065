#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "assessment.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "plant/soft/soft_mobilised.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

const char* const kLimbs[] = {"upper", "fore"};

std::shared_ptr<const MobilisedPlant> soft_plant_of(const ulna_plant* handle, bool reduced,
                                                    const char* argument) {
  const ulna_plant& plant = deref(handle, argument);
  require(plant.soft != nullptr, argument,
          std::string(argument) + " has no soft interfaces: there is nothing to reduce");
  require(plant.soft->is_reduced() == reduced, argument,
          std::string(argument) + (reduced ? " is a plant that is not reduced"
                                           : " is a reduced plant: give the one it was made from"));
  return mobilised(plant.soft);
}

sim::Mobilisation run_of(const MobilisedPlant& plant, const sim::Protocol& protocol,
                         const char* which, Token* token) {
  sim::Mobilisation done = sim::mobilise(plant, protocol, token);
  if (done.status == sim::RunStatus::kOk) return done;
  throw Error(Fault::kAnalysis, which,
              "the run of the " + std::string(which) + " plant ended as " + sim::word(done.status) +
                  ": " + done.reason);
}

Matrix displacement_of(const Record& record) {
  Matrix all(record.rows(), 6);
  Index c = 0;
  for (const char* limb : kLimbs) {
    for (const char axis : {'x', 'y', 'z'}) {
      all.col(c++) = record.column(record.find(std::string("displacement_") + limb + "_" + axis));
    }
  }
  return all;
}

PlantOutcome outcome_of(const MobilisedPlant& plant, const sim::Mobilisation& done,
                        const Viscoelasticity& v, const NominalTerms& terms) {
  const Record& record = *done.record;
  const std::vector<std::string>& device = plant.device_joints();
  const Index j = std::find(device.begin(), device.end(), v.joint) - device.begin();
  const Index h = plant.counterparts()[static_cast<std::size_t>(j)];
  PlantOutcome o{.k = v.k, .d = v.d, .k_true = v.truth.k, .slip = done.largest_slip};
  if (h >= 0) {
    const std::string& human = plant.human_joints()[static_cast<std::size_t>(h)];
    o.angle = record.column(record.find("q_" + human));
  }
  o.torque = nominal_human_torque(record, plant.nominal(), terms).col(j);
  o.displacement = displacement_of(record);
  return o;
}

using Pair = std::shared_ptr<const MobilisedPlant>[2];

std::unique_ptr<ulna_plant_difference> compare(const Pair& plants, const sim::Protocol& protocol,
                                               const ViscoelasticOptions& options, Token* token) {
  auto found = std::make_unique<ulna_plant_difference>();
  PlantOutcome outcome[2];
  for (int i = 0; i < 2; ++i) {
    const MobilisedPlant& plant = *plants[i];
    sim::Mobilisation& done = found->done[i];
    done = run_of(plant, protocol, i == 0 ? "full" : "reduced", token);
    const Viscoelasticity v =
        identify_viscoelasticity(*done.record, plant.nominal(), options, token).front();
    found->joint = v.joint;
    outcome[i] = outcome_of(plant, done, v, options.terms);
  }
  found->full = outcome[0];
  found->difference = PlantDifference::between({outcome[0]}, {outcome[1]});
  return found;
}

}  // namespace

ulna_status ulna_plant_difference_new(const ulna_plant* full, const ulna_plant* reduced,
                                      const ulna_protocol* protocol,
                                      const ulna_viscoelastic_options* options, ulna_token* token,
                                      ulna_plant_difference** out_difference) {
  return guarded([&] {
    deref(out_difference, "out_difference");
    const Pair plants = {soft_plant_of(full, false, "full"),
                         soft_plant_of(reduced, true, "reduced")};
    *out_difference =
        compare(plants, read_protocol(protocol), read_estimator(options), token_of(token))
            .release();
  });
}

void ulna_plant_difference_free(ulna_plant_difference* difference) { delete difference; }

ulna_status ulna_plant_difference_get_result(const ulna_plant_difference* difference,
                                             ulna_plant_difference_result* out_result) {
  return guarded([&] {
    const ulna_plant_difference& own = deref(difference, "difference");
    const PlantDifference& d = own.difference;
    ulna_plant_difference_result r{};
    r.full_k = own.full.k;
    r.full_k_error = own.full.k - own.full.k_true;
    r.full_d = own.full.d;
    r.full_slip_rad = own.full.slip;
    r.k = d.k[0];
    r.k_error = d.k_error[0];
    r.d = d.d[0];
    r.slip_rad = d.slip[0];
    r.torque_rms_nm = d.torque[0];
    r.angle_rms_rad = d.angle[0];
    r.displacement_rms_m = d.displacement[0];
    write_result(out_result, r, "out_result");
  });
}

ulna_status ulna_plant_difference_text(const ulna_plant_difference* difference, char* out_text,
                                       int64_t capacity, int64_t* out_size) {
  return guarded(
      [&] { write_text(deref(difference, "difference").joint, out_text, capacity, out_size); });
}

ulna_status ulna_plant_difference_record(const ulna_plant_difference* difference, int32_t reduced,
                                         ulna_record** out_record) {
  return guarded([&] {
    const ulna_plant_difference& own = deref(difference, "difference");
    require(reduced == 0 || reduced == 1, "reduced", "reduced must be 0 or 1");
    give_log(out_record, own.done[reduced]);
  });
}
