/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The page in shared memory between a haptic device's owner and its user: /dev/shm/incise-NAME.
 *
 *        owner: reads the device, gives force           user: the haptic loop
 *
 *     ┌──────┬────────┬───────────────┬──────────────┬──────────────────────────┐
 *     │ head │ device │ owner's half  │ user's half  │ ring of 32 samples       │
 *     └──────┴────────┴───────────────┴──────────────┴──────────────────────────┘
 *      owner  owner    owner           user           owner            is its only writer
 *
 * This file needs <stdint.h> alone. It describes a layout; programs under any licence may include it,
 * or restate the layout in a language of their own. doc/haptic-page.md has the rules for each side,
 * examples/haptic_page has a device in C and in Python.
 *
 * All numbers are in the byte order of the machine, all times ns of CLOCK_MONOTONIC, lengths mm,
 * forces N, and what is reserved is 0.
 */
#ifndef INCISE_HAPTIC_PAGE_H
#define INCISE_HAPTIC_PAGE_H

#include <stdint.h>

#define INCISE_HAPTIC_PAGE_MAGIC "INCISEHP" /**< 8 bytes, without its 0 */
#define INCISE_HAPTIC_PAGE_MAJOR 1	    /**< another one: another layout */
#define INCISE_HAPTIC_PAGE_MINOR 0	    /**< more of what was reserved */
#define INCISE_HAPTIC_PAGE_RING 32	    /**< samples that the page keeps */

/** Bytes of the file that a side locks (F_OFD_SETLK, F_WRLCK) for as long as it lives. */
#define INCISE_HAPTIC_PAGE_OWNER_BYTE 0
#define INCISE_HAPTIC_PAGE_USER_BYTE 1 /**< its user's */

#define INCISE_HAPTIC_PAGE_PERIOD_NS 20000000 /**< longest period of a user, ns */
/** An owner without a heartbeat for so long is dead, ns. */
#define INCISE_HAPTIC_PAGE_DEAD_NS 1000000000
/** The force returns within so long after it was 0, ns. */
#define INCISE_HAPTIC_PAGE_RAMP_NS 100000000

/** Place of a part in the page. */
struct incise_haptic_page_part {
	uint32_t offset, size; /**< bytes from the begin of the page; of one element */
	uint32_t count;	       /**< number of elements */
	uint32_t reserved;
};

/** Begin of the page. */
struct incise_haptic_page_head {
	char magic[8]; /**< written last: then the page is complete */
	uint32_t major, minor;
	uint32_t size; /**< bytes of the page */
	uint32_t pid;  /**< process id of the owner */
	struct incise_haptic_page_part device, owner, user, ring;
	uint8_t reserved[40];
};

/** Features of a device. */
enum incise_haptic_page_feature {
	INCISE_HAPTIC_PAGE_VELOCITY = 1,    /**< it gives velocities */
	INCISE_HAPTIC_PAGE_ORIENTATION = 2, /**< it gives quaternions */
	INCISE_HAPTIC_PAGE_GRAVITY = 4,	    /**< it compensates its own weight */
};

/** Properties of a device, which do not change; 0 where one is not known. Texts end with a 0. */
struct incise_haptic_info {
	char device[256];  /**< as rig.conf names it; in a page only */
	char name[64];	   /**< model and serial number */
	char filters[200]; /**< its own settings that change how a force feels; or "" */
	char note[304];	   /**< a setting that its user should check; or "" */
	double low_mm[3], high_mm[3]; /**< workspace, device's frame */
	double peak_N;		      /**< largest force */
	double continuous_N;	      /**< force that it stands for ever */
	double torque_N_mm;	      /**< largest torque; 0: it takes none */
	double mass_kg;		      /**< that the hand feels, at the handle */
	double damping_N_s_mm, coulomb_N;
	double encoder_mm; /**< resolution of the position */
	double rate_hz; /**< samples, and forces, per second; in a page 1 … 20000, never 0 */
	int64_t latency_ns;	  /**< from the acquisition to the reader */
	int64_t force_latency_ns; /**< from the request to the force */
	/** It gives no force so long after the last one, without its owner; 0: it keeps it. */
	double deadman_s;
	uint32_t buttons;  /**< number, 0 … 32 */
	uint32_t features; /**< incise_haptic_page_feature bits */
	uint32_t settings; /**< CRC of those of an owner of incise, in a page; else 0 */
	uint32_t reserved[13];
};

/** State of an owner. */
enum incise_haptic_page_state {
	INCISE_HAPTIC_PAGE_READY = 1,
	INCISE_HAPTIC_PAGE_FAILED = 2, /**< the device failed; reason has the cause */
	INCISE_HAPTIC_PAGE_ENDED = 3,  /**< the owner ended as requested */
};

/** The owner's half, written at each of its ticks. */
struct incise_haptic_page_owner {
	uint32_t seq;	      /**< sequence lock: odd while it is written */
	uint32_t state;	      /**< enum incise_haptic_page_state */
	int64_t heartbeat_ns; /**< time of this tick */
	uint64_t samples;     /**< put into the ring so far */
	uint64_t lost;	      /**< samples that the device, or its line, has lost */
	uint32_t error;	      /**< of a failed device, a positive errno, or 0 */
	uint32_t reserved0;
	char reason[256]; /**< of a failure, or of a sample's flags; ends with a 0 */
	uint32_t cuts;	  /**< times that a user's force was taken away; 0: not counted */
	char cut[16];	  /**< the reason of the last one, a word; ends with a 0 */
	uint32_t reserved;
};

/** Request of a user. */
enum incise_haptic_page_wants {
	INCISE_HAPTIC_PAGE_NOTHING = 0,
	INCISE_HAPTIC_PAGE_FORCE = 1,
	INCISE_HAPTIC_PAGE_END =
		2, /**< no force, and the end of the owner; it need not obey */
};

/** The user's half, written at each of its ticks. */
struct incise_haptic_page_user {
	uint32_t seq;	      /**< sequence lock: odd while it is written */
	uint32_t wants;	      /**< enum incise_haptic_page_wants */
	int64_t heartbeat_ns; /**< time of this tick */
	int64_t period_ns;    /**< of its ticks; at most INCISE_HAPTIC_PAGE_PERIOD_NS */
	double force_N[3], torque_N_mm[3];
	uint32_t reserved[14];
};

/** An element of the ring: sample number n is in element n % 32. */
struct incise_haptic_page_sample {
	uint32_t seq; /**< sequence lock: odd while it is written */
	uint32_t reserved0;
	uint64_t number;   /**< of this page's samples, from 0 */
	int64_t t_ns;	   /**< of the acquisition */
	uint64_t sequence; /**< the device's own count; a gap: it lost samples */
	double position_mm[3];
	double velocity_mm_s[3]; /**< 0 without INCISE_HAPTIC_PAGE_VELOCITY */
	double quaternion[4];	 /**< w first; 1 0 0 0 without …_ORIENTATION */
	uint32_t buttons;	 /**< pressed ones; the first is bit 0 */
	uint32_t flags;		 /**< enum incise_haptic_flag bits */
	uint32_t reserved[2];
};

/** The page. */
struct incise_haptic_page {
	struct incise_haptic_page_head head;				/**< at 0 */
	struct incise_haptic_info device;				/**< at 128 */
	struct incise_haptic_page_owner owner;				/**< at 1152 */
	struct incise_haptic_page_user user;				/**< at 1472 */
	struct incise_haptic_page_sample ring[INCISE_HAPTIC_PAGE_RING]; /**< at 1600 */
};

#if defined(__GNUC__)
/**
 * Write all of a part but its sequence lock, which is its first word: by its only writer. The pattern is
 * H.-J. Boehm's, 'Can seqlocks get along with programming language memory models?', MSPC 2012, figure
 * 6; a race gives a torn copy, which the lock shows, and no undefined behaviour.
 */
static inline void incise_haptic_page_put(void *part, const void *from, uint32_t bytes)
{
	uint32_t *words = (uint32_t *)part, word, i;
	uint32_t seq = __atomic_load_n(words, __ATOMIC_RELAXED) & ~1u;

	__atomic_store_n(words, seq + 1, __ATOMIC_RELAXED);
	__atomic_thread_fence(__ATOMIC_RELEASE);
	for (i = 1; i < bytes / sizeof(word); i++) {
		__builtin_memcpy(&word, (const char *)from + i * sizeof(word),
				 sizeof(word));
		__atomic_store_n(words + i, word, __ATOMIC_RELAXED);
	}
	__atomic_store_n(words, seq + 2, __ATOMIC_RELEASE);
}

/** Copy a part with its sequence lock. 1; 0: it is being written, and the copy is torn. */
static inline int incise_haptic_page_get(const void *part, void *to, uint32_t bytes)
{
	const uint32_t *words = (const uint32_t *)part;
	uint32_t word, i, seq = __atomic_load_n(words, __ATOMIC_ACQUIRE);

	if (seq & 1)
		return 0;
	__builtin_memcpy(to, &seq, sizeof(seq));
	for (i = 1; i < bytes / sizeof(word); i++) {
		word = __atomic_load_n(words + i, __ATOMIC_RELAXED);
		__builtin_memcpy((char *)to + i * sizeof(word), &word, sizeof(word));
	}
	__atomic_thread_fence(__ATOMIC_ACQUIRE);
	return __atomic_load_n(words, __ATOMIC_RELAXED) == seq;
}

/** Write the head of a page whose other parts are complete; its magic comes last. */
static inline void incise_haptic_page_publish(struct incise_haptic_page *page,
					      uint32_t pid)
{
	const struct incise_haptic_page_part parts[] = {
		{128, sizeof(page->device), 1, 0},
		{1152, sizeof(page->owner), 1, 0},
		{1472, sizeof(page->user), 1, 0},
		{1600, sizeof(*page->ring), INCISE_HAPTIC_PAGE_RING, 0},
	};

	page->head.major = INCISE_HAPTIC_PAGE_MAJOR;
	page->head.minor = INCISE_HAPTIC_PAGE_MINOR;
	page->head.size = sizeof(*page);
	page->head.pid = pid;
	page->head.device = parts[0];
	page->head.owner = parts[1];
	page->head.user = parts[2];
	page->head.ring = parts[3];
	__atomic_thread_fence(__ATOMIC_RELEASE);
	__builtin_memcpy(page->head.magic, INCISE_HAPTIC_PAGE_MAGIC,
			 sizeof(page->head.magic));
}
#endif

#endif
