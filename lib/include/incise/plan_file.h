/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A plan as a file: all that a tick of a scene on a rig needs, in integers. The kernel module runs it
 * by itself, and a program the same code.
 *
 *   SCENE + rig ─ incise compile ─▶ NAME.plan ─ incise feed ─▶ incise_stepper.ko
 *
 * The file is little-endian: magic "INCISEPL", version, size and CRC-32C, then the numbers, a
 * compiled model and the heights of a surface; lib/fixed/plan.h has its fields. It is checked in full
 * before it is used, by the same verifier here and in the kernel.
 */
#ifndef INCISE_PLAN_FILE_H
#define INCISE_PLAN_FILE_H

#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/plan.h>

/** A plan as a file; not changed after it was made. */
struct incise_plan_file;

/** Contents of a plan as a file. */
struct incise_plan_file_info {
	char scene[64];	  /**< the scene's file, without its folder */
	char surface[32]; /**< what it was in the scene: "plane", "mesh" … */
	uint32_t crc; /**< CRC-32C of what follows it: the kernel names the plan by it */
	size_t size;  /**< bytes */
	double bound_N; /**< certified error; see incise_plan_bound() */
	double rate_hz;
	double pose_age_s; /**< without a younger pose the force fades */
	double fade_s;	   /**< from the last pose until there is no force, at most */
	double force_N;	   /**< largest */
	double slew_N_s;   /**< largest change of force */
	double tracker_hz, latency_s;
	bool model;   /**< the reaction is a model's */
	bool inserts; /**< handle and tube can be held */
	bool tube;    /**< the tube has a station of the tracker */
	bool membrane;
	int cuts_most; /**< cuts that the tissue keeps; 0: without @inserts */
	int n_axes;    /**< actuators */
	struct {
		double direction[3];
		double spring_N_mm, travel_mm, step_mm;
	} axis[INCISE_RIG_AXES_MAX];
	int columns, rows;	  /**< of the surface's heights; 0: it is a formula */
	double cell_mm, reach_mm; /**< deeper than that counts as that deep */
};

/**
 * Put a plan into a file's form.
 *
 * @param plan of a scene with arithmetic "fixed", as incise_scene_set_arithmetic() sets it, and of
 *             a rig whose actuators do not measure their handle
 * @return to be freed with incise_plan_file_free(); NULL with errno EINVAL (arithmetic "double"),
 *         ERANGE (a number, or a surface, that integers do not hold; the message names it),
 *         ENOTSUP (an actuator that measures its handle), ENOMEM
 */
INCISE_API struct incise_plan_file *incise_plan_file_new(const struct incise_plan *plan,
							 struct incise_error *err);

/**
 * Read a file and check it in full.
 *
 * @return as incise_plan_file_new(); NULL with errno of incise_infile_read(), EINVAL (none, or
 *         damaged), ENOTSUP (another version), ENOMEM
 */
INCISE_API struct incise_plan_file *incise_plan_file_load(const char *path,
							  struct incise_error *err);

/** Write a file, whole or not at all. @return 0 or as incise_outfile_commit(). */
INCISE_API int incise_plan_file_save(const struct incise_plan_file *file,
				     const char *path, struct incise_error *err);

/** Get its contents. */
INCISE_API void incise_plan_file_info(const struct incise_plan_file *file,
				      struct incise_plan_file_info *info);

/** The bytes, as the kernel takes them; they live as long as @file. */
INCISE_API const void *incise_plan_file_bytes(const struct incise_plan_file *file,
					      size_t *size);

/** NULL is accepted. */
INCISE_API void incise_plan_file_free(struct incise_plan_file *file);

#endif
