/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside of a scene, for lib/scene. Names and units are the same as in the file.
 */
#ifndef INCISE_SCENE_INTERNAL_H
#define INCISE_SCENE_INTERNAL_H

#include <stdbool.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include <incise/plan.h>
#include <incise/scene.h>
#include <incise/texture.h>
#include "../base/settings.h"
#include "../control/model_input.h"
#include "../fixed/texture.h"
#include "../surface/surface.h"
#include "forces.h"

/* The model of a phase of cutting; INCISE_CUT has one where any has. */
struct incise_scene_model {
	char *path;		    /* or NULL: there is none */
	struct incise_model *model; /* one of these */
	struct incise_fixed *compiled;
	int n_inputs; /* 1 … INCISE_LOOP_INPUTS_MAX, and where each comes from */
	enum incise_model_input input[INCISE_LOOP_INPUTS_MAX];
};

/* The group surface as the file has it. */
struct incise_scene_surface {
	double point_mm[3], to_mm[3], normal[3], radius_mm;
	const char *file; /* the scene's surface_path */
	bool cavity;
};

struct incise_scene {
	char *path;
	char *surface_path; /* or NULL */
	double rate_hz;
	bool fixed;
	bool full; /* see incise_scene_set_full() */
	/*
	 * For tests of stages alone, and set by them alone: a plan is not checked to be stable, and
	 * tissue.unloading_N_mm is taken for the steepest slope of its models.
	 */
	bool unchecked;
	struct incise_scene_model cut[INCISE_CUTTING_PHASES];
	char *texture_path; /* of model.texture, or NULL */
	struct incise_fixed_texture
		*texture; /* its tables; NULL: each cut is the mean one */
	struct incise_texture_info learned; /* 0 without one in the file */
	const char *texture_left_out;	    /* why, if the file has one; or NULL */
	struct incise_surface *surface;	    /* or NULL: the rig's plane */
	const char *surface_kind;	    /* as the file names it */
	struct incise_scene_surface named;
	struct {
		double gain, leave_mm;
		bool dissipates;	  /* withdrawal = "dissipative"; else "paper" */
		bool printed_orientation; /* orientation = "paper"; else "eased" */
		double cut_from_mm, stretch_mm;
		int cuts_most, seed;
		double variation; /* share of the learned one */
		double force[INCISE_FORCES][INCISE_FORCE_NUMBERS];
	} tissue;
	struct incise_scene_membrane membrane;
	struct {
		int average_ticks;
	} effects;
	struct {
		double side[3], axis[3], handle_mm;
		double handle_width_mm, handle_thickness_mm, tube_mm;
	} tool;
	struct {
		double mass_kg, damping_N_s_mm, coulomb_N, encoder_mm;
		int delay_ticks; /* of the whole loop; or -1: the tracker's */
		int late_ticks;	 /* of the actuator, after a tracker's loop */
	} device;
	struct incise_scene_limits limits;
	struct incise_scene_criterion criteria[INCISE_CRITERIA];
	struct incise_scene_picture picture;
};

/*
 * The keys of a scene, in a struct incise_scene: of its groups; of the group tissue, including the
 * forces; and of a surface of that kind, in a struct incise_scene_surface.
 */
extern const struct incise_setting incise_scene_settings[];
void incise_scene_tissue_settings(struct incise_setting rows[SETTING_ROWS_MAX + 1]);
const struct incise_setting *incise_scene_surface_settings(const char *kind);

/* Numbers of its tissue and tools for its cuts. */
struct incise_double_incision_setup incise_scene_cuts(const struct incise_scene *scene);

#endif
