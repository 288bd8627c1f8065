// A plant whose device holds the arm by soft interfaces, full or reduced, as the protocol of an
// assessment sees it.
#pragma once

#include <memory>

#include "plant/mobilised.hpp"
#include "plant/soft/soft_plant.hpp"

namespace ulna {

// Channels beside those of every plant, for each interface <i> ("upper", "fore"), cuff frame:
// F_<i>_cuff_x, _y, _z, M_<i>_cuff_x, _y, _z (N, N m: on the limb, about the tissue's centre), the
// same of the strap; displacement_<i>_x, _y, _z (m) and turn_<i> (rad) of the limb since it was
// donned; of a full plant also pressure_<i> (largest on the skin, Pa), area_<i> (pressed, m^2),
// tension_<i> (of the strap, N) and slide_<i> (of the skin along the cuff since donned, m).
// nominal: the scene of the nominal model; NULL: the plant's own description, the arm rigidly in
// it. Throws Error (kArgument) for a scene without muscles' joints, as mobilised() does.
std::shared_ptr<const MobilisedPlant> mobilised(std::shared_ptr<const SoftPlant> plant,
                                                const ExoScene* nominal = nullptr);

}  // namespace ulna
