// SPDX-License-Identifier: GPL-2.0-only
/*
 * The lines as gpiolib sees them. A line has two levels, the one that the chip
 * puts out and the one that the world outside drives; its direction selects
 * which one counts:
 *
 *	set() --------> out ----\  output
 *	                         >---------> level
 *	inputs, --> driven -----/  input
 *	carriage, script
 */
#include <linux/module.h>

#include "../compat.h"
#include "sim.h"

/* The level of an output has changed: pass it on in the order of cause and effect. */
static void sim_changed_locked(struct sim *sim, unsigned int line, bool value,
			       unsigned int flags)
{
	sim_edges_put_locked(sim, line, value, flags);
	sim_carriage_step_locked(sim, line, value);
	sim_script_count_locked(sim, line, value);
}

static void sim_put_out_locked(struct sim *sim, unsigned int line, bool value)
{
	if (test_bit(line, sim->out) == value) {
		sim->ring.repeats++;
		return;
	}
	__assign_bit(line, sim->out, value);
	if (test_bit(line, sim->output))
		sim_changed_locked(sim, line, value, 0);
}

static int sim_set(struct gpio_chip *chip, unsigned int line, int value)
{
	struct sim *sim = gpiochip_get_data(chip);
	unsigned long flags;

	raw_spin_lock_irqsave(&sim->lock, flags);
	sim_put_out_locked(sim, line, value);
	sim_settle_locked(sim);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	return 0;
}

COMPAT_GPIO_SET(sim_set)

static int sim_get(struct gpio_chip *chip, unsigned int line)
{
	struct sim *sim = gpiochip_get_data(chip);

	/* One word is read at a time: no need for the lock. */
	return test_bit(line, sim->unreadable) ? -EIO : sim_level_locked(sim, line);
}

static int sim_get_direction(struct gpio_chip *chip, unsigned int line)
{
	struct sim *sim = gpiochip_get_data(chip);

	return test_bit(line, sim->output) ? GPIO_LINE_DIRECTION_OUT
					   : GPIO_LINE_DIRECTION_IN;
}

static int sim_direction_input(struct gpio_chip *chip, unsigned int line)
{
	struct sim *sim = gpiochip_get_data(chip);
	unsigned long flags;

	raw_spin_lock_irqsave(&sim->lock, flags);
	if (test_and_clear_bit(line, sim->output))
		sim_edges_put_locked(sim, line, test_bit(line, sim->driven),
				     INCISE_SIM_EDGE_INPUT | INCISE_SIM_EDGE_CONFIGURED);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	return 0;
}

static int sim_direction_output(struct gpio_chip *chip, unsigned int line, int value)
{
	struct sim *sim = gpiochip_get_data(chip);
	unsigned long flags;

	raw_spin_lock_irqsave(&sim->lock, flags);
	if (test_bit(line, sim->output)) {
		sim_put_out_locked(sim, line, value);
	} else {
		bool before = test_bit(line, sim->driven);

		__assign_bit(line, sim->out, value);
		__set_bit(line, sim->output);
		/* A motor's driver sees an edge only where there is one. */
		if (before != !!value)
			sim_changed_locked(sim, line, value, INCISE_SIM_EDGE_CONFIGURED);
		else
			sim_edges_put_locked(sim, line, value,
					     INCISE_SIM_EDGE_CONFIGURED);
	}
	sim_settle_locked(sim);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	return 0;
}

int sim_chip_add(struct sim *sim, struct device *parent)
{
	struct gpio_chip *chip = &sim->chip;
	int ret;

	/* After an unbind it starts as new, but for the ring: a log outlives it. */
	bitmap_zero(sim->output, INCISE_SIM_LINES_MAX);
	bitmap_zero(sim->out, INCISE_SIM_LINES_MAX);
	bitmap_zero(sim->driven, INCISE_SIM_LINES_MAX);
	memset(chip, 0, sizeof(*chip));
	chip->label = INCISE_SIM_LABEL;
	chip->parent = parent;
	chip->owner = THIS_MODULE;
	chip->base = -1;
	chip->ngpio = sim->lines;
	chip->can_sleep = false;
	chip->get_direction = sim_get_direction;
	chip->direction_input = sim_direction_input;
	chip->direction_output = sim_direction_output;
	chip->get = sim_get;
	chip->set = compat_gpio_set(sim_set);
	sim_interrupt_init(sim);
	ret = gpiochip_add_data(chip, sim);
	if (!ret)
		sim_faults_chip(sim);
	return ret;
}

void sim_chip_remove(struct sim *sim)
{
	gpiochip_remove(&sim->chip);
	irq_work_sync(&sim->work);
}
