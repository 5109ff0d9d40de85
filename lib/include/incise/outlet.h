/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Outlets of the Lab Streaming Layer: streams of numbers, or of texts, for any program that speaks
 * it. A module, outlet_lsl.so, is loaded by incise_outlets_open(), and opens liblsl; nothing else
 * maps them. Part of libincise.
 */
#ifndef INCISE_OUTLET_H
#define INCISE_OUTLET_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** A channel, in the words of XDF. */
struct incise_outlet_channel {
	const char *label; /**< "Fz" */
	const char *type;  /**< "ForceZ" */
	const char *unit;  /**< "N" */
};

/** A stream. */
struct incise_outlet_setup {
	const char *name;      /**< by which others find it */
	const char *type;      /**< of the content: "MoCap", "Force", "Markers" */
	const char *source_id; /**< the same after a restart: others find it again */
	double rate_hz;	       /**< nominal; 0: irregular */
	const struct incise_outlet_channel *channels;
	int n; /**< channels; 0: one channel of text */
};

struct incise_outlet;

/**
 * Functions of the module. Each open outlet has threads of liblsl, and memory for 10 s of values
 * for each reader; a slower reader loses the oldest.
 */
struct incise_outlets {
	/** Offer a stream. NULL with errno EIO, ENOMEM, and a message. */
	struct incise_outlet *(*open)(const struct incise_outlet_setup *setup,
				      struct incise_error *err);
	/** Send the values of all channels; never waits. @t_ns: CLOCK_MONOTONIC. */
	void (*push)(struct incise_outlet *outlet, const double *values, int64_t t_ns);
	/** The same for a stream of text. */
	void (*push_text)(struct incise_outlet *outlet, const char *text, int64_t t_ns);
	/** Whether a client reads it now. */
	bool (*has_readers)(struct incise_outlet *outlet);
	/** End the stream; NULL is accepted. */
	void (*close)(struct incise_outlet *outlet);
};

/**
 * Load the module and liblsl.
 *
 * @param where   begin of messages: the option or key that asks for it
 * @param outlets result, static
 * @return 0; -ENOENT (no module, or no liblsl: the message says what to install), -ENOEXEC (one
 *         of the two is broken)
 */
INCISE_API int incise_outlets_open(const char *where,
				   const struct incise_outlets **outlets,
				   struct incise_error *err);

INCISE_END_DECLS
#endif
