/* ulna: from a recorded or simulated experiment to the impedance of the human arm, a passivity
 * verdict and the uncertainty of both. This header includes every stable one. */
#ifndef ULNA_ULNA_H
#define ULNA_ULNA_H

#include <ulna/arm_support.h>
#include <ulna/assessment.h>
#include <ulna/base.h>
#include <ulna/batch.h>
#include <ulna/body.h>
#include <ulna/design.h>
#include <ulna/estimate.h>
#include <ulna/exo.h>
#include <ulna/frf.h>
#include <ulna/ident.h>
#include <ulna/impedance.h>
#include <ulna/joint.h>
#include <ulna/models.h>
#include <ulna/mvnx.h>
#include <ulna/passivity.h>
#include <ulna/plant.h>
#include <ulna/record.h>
#include <ulna/reflex.h>
#include <ulna/render.h>
#include <ulna/rig.h>
#include <ulna/signal.h>
#include <ulna/sim.h>
#include <ulna/soft.h>
#include <ulna/stats.h>
#include <ulna/study.h>
#include <ulna/system.h>

#endif
