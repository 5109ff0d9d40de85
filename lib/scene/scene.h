/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside of a scene, for the files of this room. Names and units are those of the file.
 */
#ifndef INCISE_SCENE_INTERNAL_H
#define INCISE_SCENE_INTERNAL_H

#include <libconfig.h>
#include <stdbool.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include <incise/scene.h>
#include "../surface/surface.h"

struct incise_scene {
	char *path;
	double rate_hz;
	bool fixed;
	bool full;		    /* see incise_scene_set_full() */
	struct incise_model *model; /* one of these, or none */
	struct incise_fixed *compiled;
	struct incise_surface *surface; /* or NULL: the rig's plane */
	struct {
		double gain;
		double reaction_N_mm;  /* Kn */
		double plane_N_mm;     /* Kx */
		double damping_N_s_mm; /* Kd */
		double insertion_N_mm; /* Ky */
		double aligned;	       /* least Fort */
		double spread_N_mm;    /* Kxz */
		double leave_mm;
	} tissue;
	struct {
		int average_ticks;
		bool guard;
	} effects;
	struct {
		double side[3], axis[3], handle_mm;
	} tool;
	struct {
		double mass_kg, damping_N_s_mm, coulomb_N, encoder_mm;
		int delay_ticks; /* or -1: the tracker's */
	} device;
	struct incise_scene_limits limits;
	struct incise_scene_picture picture;
};

/* Read the group `surface`, if it is there; files are relative to the scene's folder. */
int incise_scene_read_surface(struct incise_scene *scene, const config_setting_t *root,
			      struct incise_error *err);

/* Read the group `picture`, if it is there. */
int incise_scene_read_picture(struct incise_scene *scene, const config_setting_t *root,
			      struct incise_error *err);
void incise_scene_picture_defaults(struct incise_scene_picture *picture);

/* A name in a scene is relative to the scene's folder. To be freed; NULL: no memory. */
char *incise_scene_beside(const struct incise_scene *scene, const char *name);

#endif
