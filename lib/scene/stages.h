/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The stages of a plan, but for the forces, which are in forces.h.
 */
#ifndef INCISE_STAGES_H
#define INCISE_STAGES_H

#include "plan.h"

/* From poses to the tool on the surface. */
incise_stage_fn incise_stage_pose;
incise_stage_fn incise_stage_fed;
incise_stage_fn incise_stage_predict;
incise_stage_fn incise_stage_tool;
incise_stage_fn incise_stage_contact;
incise_stage_fn incise_stage_normal;

/* From the tissue's force to the hand. */
incise_stage_fn incise_stage_guard;
incise_stage_fn incise_stage_start;
incise_stage_fn incise_stage_limit;
incise_stage_fn incise_stage_actuate;

#endif
