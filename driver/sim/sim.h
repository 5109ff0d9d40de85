/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * The simulator from the inside: one chip with its lines, interrupts, ring of
 * edges, carriages and scripts. All of it changes under one raw spinlock, so
 * that a limit input is true in the same instant as the step that reached it.
 *
 *	set() -> level -> ring                     (timestamped)
 *	               -> carriage -> inputs \
 *	               -> script   -> inputs -> ring, interrupt (irq_work)
 *
 * set() is called from hard interrupts, on PREEMPT_RT too: nothing here may
 * sleep or allocate.
 */
#ifndef INCISE_SIM_SIM_H
#define INCISE_SIM_SIM_H

#include <linux/bitmap.h>
#include <linux/debugfs.h>
#include <linux/gpio/driver.h>
#include <linux/irq_work.h>
#include <linux/mutex.h>
#include <linux/spinlock.h>

#include "incise_sim.h"

#define SIM_NO_LINE (-1)

/**
 * struct sim_ring - edges on their way to user space
 * @edge:	the edges, @size of them, a power of two
 * @size:	how many fit
 * @head:	edges put in; written under the simulator's lock
 * @tail:	edges taken out; written under @reader
 * @sequence:	edges that ever were, lost ones included
 * @lost:	edges that found the ring full
 * @repeats:	outputs that were set to the level they had
 * @reader:	one reader at a time
 */
struct sim_ring {
	struct incise_sim_edge *edge;
	u32 size;
	u32 head;
	u32 tail;
	u64 sequence;
	u64 lost;
	u64 repeats;
	struct mutex reader; /* one reader at a time */
};

/* The lines of a carriage, in the order of sim_carriage_names. */
enum sim_carriage_line {
	SIM_STEP,
	SIM_DIR,
	SIM_ENABLE,
	SIM_MIN,
	SIM_MAX,
	SIM_HOME,
	SIM_CARRIAGE_LINES
};

/**
 * struct sim_carriage - mechanics behind a step and a direction line
 * @used:	there is one
 * @line:	offset or SIM_NO_LINE
 * @inverted:	BIT(enum sim_carriage_line) of lines that are active low
 * @min_at:	the min input is active here and below
 * @max_at:	the max input is active here and above
 * @home_from:	the home input is active from here ...
 * @home_to:	... to here
 * @position:	in steps
 * @lowest:	lowest position since it was set up
 * @highest:	highest position since it was set up
 * @up:		steps up
 * @down:	steps down
 * @ignored:	steps while the enable line was inactive
 * @ignore:	so many of the next steps are ignored too
 */
struct sim_carriage {
	bool used;
	int line[SIM_CARRIAGE_LINES];
	unsigned int inverted;
	s64 min_at;
	s64 max_at;
	s64 home_from;
	s64 home_to;
	s64 position;
	s64 lowest;
	s64 highest;
	u64 up;
	u64 down;
	u64 ignored;
	u64 ignore;
};

/**
 * struct sim_script - an input that changes after some edges of a line
 * @used:	there is one
 * @rising:	rising edges count
 * @falling:	falling edges count
 * @line:	whose edges are counted
 * @set:	the input to drive
 * @value:	its level then
 * @left:	edges that are still to come; 0: it has fired
 * @fired_ns:	when it fired, CLOCK_MONOTONIC
 */
struct sim_script {
	bool used;
	bool rising;
	bool falling;
	u16 line;
	u16 set;
	u8 value;
	u64 left;
	s64 fired_ns;
};

/**
 * struct sim - the simulated chip
 * @lock:	guards everything but the ring's reading end; taken in hard
 *		interrupts
 * @chip:	what gpiolib sees
 * @lines:	number of lines
 * @output:	lines that are outputs
 * @out:	levels that outputs have (or will have)
 * @driven:	levels that inputs have (or will have)
 * @work:	delivers interrupts, in hard interrupt context
 * @pending:	interrupts to deliver
 * @unmasked:	lines whose interrupt may be delivered
 * @rising:	lines that interrupt when they rise
 * @falling:	lines that interrupt when they fall
 * @interrupts:	interrupts delivered
 * @held:	interrupts stay pending
 * @to_irq:	gpiolib's own
 * @no_irq:	what to_irq() answers instead, a negative errno; 0: as it should
 * @unreadable:	lines whose level cannot be read
 * @ring:	edges
 * @carriage:	mechanics
 * @steps_of:	which carriages step by a line, one bit each
 * @script:	scripted inputs
 * @scripts_of:	which scripts wait for edges of a line, one bit each
 * @fired:	scripts whose input is to be driven before the lock is released
 * @dir:	the folder in debugfs
 */
struct sim {
	raw_spinlock_t lock;
	struct gpio_chip chip;
	unsigned int lines;
	DECLARE_BITMAP(output, INCISE_SIM_LINES_MAX);
	DECLARE_BITMAP(out, INCISE_SIM_LINES_MAX);
	DECLARE_BITMAP(driven, INCISE_SIM_LINES_MAX);

	struct irq_work work;
	DECLARE_BITMAP(pending, INCISE_SIM_LINES_MAX);
	DECLARE_BITMAP(unmasked, INCISE_SIM_LINES_MAX);
	DECLARE_BITMAP(rising, INCISE_SIM_LINES_MAX);
	DECLARE_BITMAP(falling, INCISE_SIM_LINES_MAX);
	u64 interrupts;
	bool held;

	int (*to_irq)(struct gpio_chip *chip, unsigned int line);
	int no_irq;
	DECLARE_BITMAP(unreadable, INCISE_SIM_LINES_MAX);

	struct sim_ring ring;
	struct sim_carriage carriage[INCISE_SIM_CARRIAGES];
	u8 steps_of[INCISE_SIM_LINES_MAX];
	struct sim_script script[INCISE_SIM_SCRIPTS];
	u64 scripts_of[INCISE_SIM_LINES_MAX];
	u64 fired;

	struct dentry *dir;
};

/* Functions that end in _locked want sim->lock; _files make the files in debugfs. */
/* chip.c */
int sim_chip_add(struct sim *sim, struct device *parent);
void sim_chip_remove(struct sim *sim);

/* interrupt.c */
void sim_interrupt_init(struct sim *sim);
void sim_interrupt_edge_locked(struct sim *sim, unsigned int line, bool value);
void sim_interrupt_hold(struct sim *sim, bool hold);

/* faults.c */
void sim_faults_chip(struct sim *sim);
void sim_faults_files(struct sim *sim);

/* edges.c */
int sim_edges_init(struct sim *sim, unsigned int size);
void sim_edges_free(struct sim *sim);
void sim_edges_put_locked(struct sim *sim, unsigned int line, bool value,
			  unsigned int flags);
void sim_edges_files(struct sim *sim);

/* carriage.c */
void sim_carriage_step_locked(struct sim *sim, unsigned int line, bool value);
void sim_carriage_files(struct sim *sim);

/* inputs.c */
bool sim_level_locked(const struct sim *sim, unsigned int line);
void sim_script_count_locked(struct sim *sim, unsigned int line, bool value);
void sim_drive_locked(struct sim *sim, unsigned int line, bool value);
void sim_settle_locked(struct sim *sim);
void sim_inputs_files(struct sim *sim);

/* text.c: text that people write into debugfs */
ssize_t sim_text_write(const char __user *from, size_t size,
		       int (*parse)(void *of, char *text), void *of);
char *sim_text_word(char **text);
bool sim_text_key(char *word, const char *key, char **value);
int sim_text_line(const struct sim *sim, const char *text, int *line);
int sim_text_bool(const char *text, bool *value);

#endif
