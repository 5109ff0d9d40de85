// SPDX-License-Identifier: GPL-2.0-only
/*
 * Interrupts of the lines: rising, falling or both edges. An edge of an input
 * is latched in the same moment as its level and delivered from an irq_work,
 * that is from a hard interrupt of its own, after the lock is released: the
 * handler finds the new level and may call set().
 *
 * An edge that comes while the interrupt is masked is kept and delivered when
 * it is unmasked, as hardware does it.
 */
#include <linux/interrupt.h>
#include <linux/irq.h>
#include <linux/irqdomain.h>
#include <linux/module.h>

#include "sim.h"

void sim_interrupt_edge_locked(struct sim *sim, unsigned int line, bool value)
{
	if (!test_bit(line, value ? sim->rising : sim->falling))
		return;
	__set_bit(line, sim->pending);
	if (test_bit(line, sim->unmasked) && !sim->held)
		irq_work_queue(&sim->work);
}

static void sim_interrupt_deliver(struct irq_work *work)
{
	struct sim *sim = container_of(work, struct sim, work);
	DECLARE_BITMAP(due, INCISE_SIM_LINES_MAX);
	unsigned long flags;
	unsigned int line;

	raw_spin_lock_irqsave(&sim->lock, flags);
	bitmap_zero(due, INCISE_SIM_LINES_MAX);
	if (!sim->held)
		bitmap_and(due, sim->pending, sim->unmasked, INCISE_SIM_LINES_MAX);
	bitmap_andnot(sim->pending, sim->pending, due, INCISE_SIM_LINES_MAX);
	sim->interrupts += bitmap_weight(due, INCISE_SIM_LINES_MAX);
	raw_spin_unlock_irqrestore(&sim->lock, flags);

	for_each_set_bit(line, due, sim->lines)
		generic_handle_domain_irq(sim->chip.irq.domain, line);
}

/* Keep all interrupts pending, or deliver the kept ones before it returns. */
void sim_interrupt_hold(struct sim *sim, bool hold)
{
	unsigned long flags;

	raw_spin_lock_irqsave(&sim->lock, flags);
	sim->held = hold;
	if (!hold)
		irq_work_queue(&sim->work);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	irq_work_sync(&sim->work);
}

static void sim_interrupt_ack(struct irq_data *data)
{
	/* Delivering has done it. */
}

static void sim_interrupt_mask(struct irq_data *data)
{
	struct gpio_chip *chip = irq_data_get_irq_chip_data(data);
	struct sim *sim = gpiochip_get_data(chip);
	irq_hw_number_t line = irqd_to_hwirq(data);
	unsigned long flags;

	raw_spin_lock_irqsave(&sim->lock, flags);
	__clear_bit(line, sim->unmasked);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	gpiochip_disable_irq(chip, line);
}

static void sim_interrupt_unmask(struct irq_data *data)
{
	struct gpio_chip *chip = irq_data_get_irq_chip_data(data);
	struct sim *sim = gpiochip_get_data(chip);
	irq_hw_number_t line = irqd_to_hwirq(data);
	unsigned long flags;

	gpiochip_enable_irq(chip, line);
	raw_spin_lock_irqsave(&sim->lock, flags);
	__set_bit(line, sim->unmasked);
	if (test_bit(line, sim->pending) && !sim->held)
		irq_work_queue(&sim->work);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
}

static int sim_interrupt_type(struct irq_data *data, unsigned int type)
{
	struct gpio_chip *chip = irq_data_get_irq_chip_data(data);
	struct sim *sim = gpiochip_get_data(chip);
	irq_hw_number_t line = irqd_to_hwirq(data);
	unsigned long flags;

	if (type & ~(unsigned int)IRQ_TYPE_EDGE_BOTH)
		return -EINVAL;
	raw_spin_lock_irqsave(&sim->lock, flags);
	__assign_bit(line, sim->rising, type & IRQ_TYPE_EDGE_RISING);
	__assign_bit(line, sim->falling, type & IRQ_TYPE_EDGE_FALLING);
	/* An edge from before the new owner's request does not concern it. */
	__clear_bit(line, sim->pending);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	return 0;
}

static const struct irq_chip sim_irq_chip = {
	.name = INCISE_SIM_LABEL,
	.irq_ack = sim_interrupt_ack,
	.irq_mask = sim_interrupt_mask,
	.irq_unmask = sim_interrupt_unmask,
	.irq_set_type = sim_interrupt_type,
	.flags = IRQCHIP_IMMUTABLE | IRQCHIP_SKIP_SET_WAKE,
	GPIOCHIP_IRQ_RESOURCE_HELPERS,
};

void sim_interrupt_init(struct sim *sim)
{
	struct gpio_irq_chip *irq = &sim->chip.irq;

	bitmap_zero(sim->pending, INCISE_SIM_LINES_MAX);
	bitmap_zero(sim->unmasked, INCISE_SIM_LINES_MAX);
	bitmap_zero(sim->rising, INCISE_SIM_LINES_MAX);
	bitmap_zero(sim->falling, INCISE_SIM_LINES_MAX);
	sim->held = false;
	sim->work = IRQ_WORK_INIT_HARD(sim_interrupt_deliver);
	gpio_irq_chip_set_chip(irq, &sim_irq_chip);
	irq->default_type = IRQ_TYPE_NONE;
	irq->handler = handle_edge_irq;
}
