"""Which of the selected causes are reported, and with what they are confounded."""
